// Scale readings beside the tracker's points. Case B of the reference data, and simulated runs.
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/model_comparison.hpp"
#include "abbe/calib/otf/identify.hpp"
#include "encoder_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

/// 10000 mm/min, blocks of 20 samples; mean error with and without scale readings, ref.json
/// cases.B: 0.2087 and 1.908 um.
class CaseB : public testing::TestWithParam<Estimator> {
 protected:
  void SetUp() override {
    const auto stream = big_file("caseB_stream_noisy.i32"),
               log = big_file("caseB_encoder_250Hz.i32"), tables = big_file("caseB_tables.csv");
    if (!stream || !log || !tables) {
      GTEST_SKIP() << "the data of case B are not there: set ABBE_REF_DIR";
    }
    samples_ = read_stream(*stream);
    for (const ReferenceRow& row : read_rows(*tables)) {
      truth_.push_back(row.values.at(row.values.size() - 3));
    }
    const std::vector<std::int32_t> counts = read_binary<std::int32_t>(*log);
    for (std::size_t i = 0; i < counts.size() / 3; ++i) {
      log_.readings.push_back(
          {static_cast<double>(i) / 250.0,
           1e-8 * Vector3(counts[3 * i], counts[3 * i + 1], counts[3 * i + 2])});
    }
  }

  [[nodiscard]] Result<Identification> identified(const EncoderLog* log) const {
    Options options;
    options.estimator = GetParam();
    options.block_samples = 20;
    options.corner_m = 0.02;
    options.encoders = log;
    Path path;
    for (const ReferenceRow& row : read_rows(small_file("path_base.csv"))) {
      path.vertices_m.emplace_back(row.values.at(0), row.values.at(1), row.values.at(2));
    }
    return identify(samples_, case_a_machine(), path, {}, options);
  }

  [[nodiscard]] VectorStatistics grid_error_of(const VolumetricModel& model) const {
    const Machine machine = case_a_machine();
    const ParameterLayout layout = layout_of(machine);
    std::vector<Vector3> left;
    for (const Vector3& q : tensor_grid(machine.nodes)) {
      left.push_back(model.V_at(q, machine.target_offset_m) -
                     volumetric_error(layout, {truth_.data(), layout.model_size()}, q,
                                      machine.target_offset_m));
    }
    return vector_statistics(left);
  }

  std::vector<TrackerObservation> samples_;
  EncoderLog log_;
  std::vector<double> truth_;
};
INSTANTIATE_TEST_SUITE_P(OtfEstimators, CaseB,
                         testing::Values(Estimator::TwoStep, Estimator::Joint));

TEST_P(CaseB, HasTheErrorAndTheClockOfThePrototype) {
  const auto id = identified(&log_);
  ASSERT_TRUE(id) << id.error().text;
  ASSERT_TRUE(id->solution.synchronisation) << id->observations.notes.back();
  const Synchronisation& s = *id->solution.synchronisation;

  const double asked_m = GetParam() == Estimator::Joint ? 0.21e-6 : 0.25e-6;
  EXPECT_LE(grid_error_of(id->solution.model).mean_m, asked_m);
  const double offset_s = s.clock.offset_s - s.clock.drift * s.clock.reference_s;
  EXPECT_NEAR(offset_s, 3.7e-3, 3.0 * s.u_offset_s);
  EXPECT_NEAR(s.clock.drift, 2e-5, 3.0 * s.u_drift);
  EXPECT_LT(s.u_offset_s, 2e-6);
  EXPECT_EQ(s.sigma_factor, 1.0);
}

TEST_P(CaseB, WithoutReadingsHasTheErrorOfThePrototype) {
  const auto id = identified(nullptr);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_FALSE(id->solution.synchronisation);
  EXPECT_NEAR(grid_error_of(id->solution.model).mean_m, 1.907891e-6, 0.2e-6);
}

/// A run with scale readings of a machine whose clock is 0.25 s ahead.
TEST(SynchronisedEstimate, FindsTheClock) {
  for (const Estimator estimator : {Estimator::TwoStep, Estimator::Joint}) {
    EncoderRun run = make_encoder_run({});
    run.run.options.estimator = estimator;
    const auto id = identify_with_readings(run);
    ASSERT_TRUE(id) << id.error().text;
    ASSERT_TRUE(id->solution.synchronisation);
    const Synchronisation& s = *id->solution.synchronisation;
    EXPECT_NEAR(s.clock.offset_s, run.clock.offset_s, 3.0 * s.u_offset_s);
    EXPECT_NEAR(s.clock.drift, run.clock.drift, 3.0 * s.u_drift);
    EXPECT_GT(s.rows, 500u);
  }
}

/// The squared errors of V and of the clock, relative to their stated variances, over 6 runs.
TEST(SynchronisedEstimate, StatesAnHonestUncertainty) {
  double of_V = 0.0, of_clock = 0.0;
  std::size_t components = 0;
  constexpr unsigned kRuns = 6;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    EncoderRun run = make_encoder_run({.seed = seed});
    run.run.options.estimator = Estimator::Joint;
    const auto id = identify_with_readings(run);
    ASSERT_TRUE(id) << id.error().text;
    ASSERT_TRUE(id->solution.synchronisation);
    const Synchronisation& s = *id->solution.synchronisation;
    of_clock += std::pow((s.clock.offset_s - run.clock.offset_s) / s.u_offset_s, 2);
    of_clock += std::pow((s.clock.drift - run.clock.drift) / s.u_drift, 2);

    const Vector3& t_m = run.run.machine.target_offset_m;
    const ParameterLayout layout = layout_of(run.run.machine);
    for (const Vector3& q : tensor_grid(run.run.machine.nodes)) {
      const VolumetricError e = id->solution.model.error_at(q, t_m);
      const Vector3 left =
          e.V_m - volumetric_error(layout, {run.run.truth.data(), layout.model_size()}, q, t_m);
      for (Eigen::Index k = 0; k < 3; ++k) {
        if (e.cov_V_m2(k, k) > 1e-18) {  // not fixed by the gauge
          of_V += left(k) * left(k) / e.cov_V_m2(k, k);
          ++components;
        }
      }
    }
  }
  of_V /= static_cast<double>(components);
  of_clock /= 2.0 * kRuns;
  EXPECT_GT(of_V, 0.6);
  EXPECT_LT(of_V, 1.6);
  EXPECT_GT(of_clock, 0.2);  // 12 squares: standard deviation 0.41
  EXPECT_LT(of_clock, 2.4);
}

}  // namespace
