// Scale readings beside the tracker's points. Case B of the reference data, and simulated runs.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <string>
#include <utility>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "encoder_run.hpp"
#include "normalised_error.hpp"
#include "repetitions.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

/// 10000 mm/min, segments of 20 samples; mean error with and without scale readings, ref.json
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
    options.segment_samples = 20;
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
                         testing::Values(Estimator::TwoStep, Estimator::Simultaneous));

TEST_P(CaseB, HasTheErrorAndTheClockOfThePrototype) {
  const auto id = identified(&log_);
  ASSERT_TRUE(id) << id.error().text;
  ASSERT_TRUE(id->solution.synchronisation) << id->observations.notes.back();
  const Synchronisation& s = *id->solution.synchronisation;

  const double asked_m = GetParam() == Estimator::Simultaneous ? 0.21e-6 : 0.25e-6;
  EXPECT_LE(grid_error_of(id->solution.model).mean_m, asked_m);
  const double offset_s = s.clock.offset_s - s.clock.drift * s.clock.origin_s;
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
EncoderRun encoder_run(unsigned seed, Estimator estimator) {
  EncoderRun run = make_encoder_run({.seed = seed});
  run.run.options.estimator = estimator;
  return run;
}

/// Of encoder_run(); each is identified once.
const Result<Identification>& identified_with_readings(unsigned seed, Estimator estimator) {
  static std::map<std::pair<unsigned, Estimator>, Result<Identification>> found;
  const std::pair key(seed, estimator);
  if (const auto one = found.find(key); one != found.end()) {
    return one->second;
  }
  return found.emplace(key, identify_with_readings(encoder_run(seed, estimator))).first->second;
}

TEST(SynchronisedEstimate, FindsTheClock) {
  for (const Estimator estimator : {Estimator::TwoStep, Estimator::Simultaneous}) {
    const EncoderRun run = encoder_run(1, estimator);
    const auto& id = identified_with_readings(1, estimator);
    ASSERT_TRUE(id) << id.error().text;
    ASSERT_TRUE(id->solution.synchronisation);
    const Synchronisation& s = *id->solution.synchronisation;
    EXPECT_NEAR(s.clock.offset_s, run.clock.offset_s, 3.0 * s.u_offset_s);
    EXPECT_NEAR(s.clock.drift, run.clock.drift, 3.0 * s.u_drift);
    EXPECT_GT(s.rows, 500u);
  }
}

/// Times since 1970, of either clock or of both, are the same times: but for steps of 0.24 us,
/// which are 0.1 um of travel in one reading.
TEST(SynchronisedEstimate, TakesTimesSince1970) {
  constexpr double kSince1970_s = 1.7e9;
  for (const Estimator estimator : {Estimator::TwoStep, Estimator::Simultaneous}) {
    const EncoderRun run = encoder_run(1, estimator);
    const auto& wanted = identified_with_readings(1, estimator);
    ASSERT_TRUE(wanted) << wanted.error().text;
    for (const bool tracker_too : {false, true}) {
      EncoderRun later = run;
      for (EncoderReading& r : later.log.readings) {
        r.time_s += kSince1970_s;
      }
      for (TrackerObservation& s : later.run.samples) {
        s.time_s += tracker_too ? kSince1970_s : 0.0;
      }
      const auto id = identify_with_readings(later);
      ASSERT_TRUE(id) << id.error().text;
      ASSERT_TRUE(id->solution.synchronisation);
      const Synchronisation &a = *wanted->solution.synchronisation,
                            &b = *id->solution.synchronisation;
      EXPECT_EQ(a.rows, b.rows);
      const double between_s = tracker_too ? 0.0 : kSince1970_s;
      EXPECT_NEAR(b.clock.offset_s - between_s, a.clock.offset_s, 0.5 * a.u_offset_s);
      const Eigen::VectorXd d = id->solution.model.U() - wanted->solution.model.U();
      const Eigen::VectorXd u = wanted->solution.model.covariance().diagonal().cwiseSqrt();
      EXPECT_LT((d.array().abs() - 0.05 * u.array()).maxCoeff(), 1e-12);
    }
  }
}

/// Eight runs of 31 combinations each: standard deviation of the mean 0.09.
TEST(SynchronisedEstimate, StatesAnHonestUncertainty) {
  double of_tables = 0.0, of_clock = 0.0;
  constexpr unsigned kRuns = abbe::tests::repetitions(8u);
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    const EncoderRun run = encoder_run(seed, Estimator::Simultaneous);
    const auto& id = identified_with_readings(seed, Estimator::Simultaneous);
    ASSERT_TRUE(id) << id.error().text;
    ASSERT_TRUE(id->solution.synchronisation);
    const Synchronisation& s = *id->solution.synchronisation;
    EXPECT_GT(s.u_offset_s, 0.0);
    EXPECT_GT(s.u_drift, 0.0);
    of_clock += std::pow((s.clock.offset_s - run.clock.offset_s) / s.u_offset_s, 2);
    of_clock += std::pow((s.clock.drift - run.clock.drift) / s.u_drift, 2);
    of_tables += normalised_error_square(run.run, id->solution.model) / kRuns;
  }
  RecordProperty("mean_squared_normalised_error", std::to_string(of_tables));
  if (abbe::tests::kAllRepetitions) {
    EXPECT_NEAR(of_tables, 1.0, 0.25);
    EXPECT_NEAR(of_clock / (2.0 * kRuns), 1.0, 1.0);  // 16 squares: standard deviation 0.35
  }
}

/// Noise of 1 s in all components: the rows along the travel are as good as those across it.
TEST(SynchronisedEstimate, DoesNotTakeCorrelatedNoiseForErrorsOfTheReadings) {
  EncoderRun run = make_encoder_run({});
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const double kept = std::exp(-1.0 / 250.0);  // from sample to sample
  const double sigma_m = 2e-6 * std::sqrt(1.0 - kept * kept);
  Vector3 slow_m = Vector3::Zero();
  for (TrackerObservation& sample : run.run.samples) {
    slow_m = kept * slow_m + sigma_m * Vector3(normal(random), normal(random), normal(random));
    sample.p_tracker_m += slow_m;
  }

  for (const Estimator estimator : {Estimator::TwoStep, Estimator::Simultaneous}) {
    run.run.options.estimator = estimator;
    const auto id = identify_with_readings(run);
    ASSERT_TRUE(id) << id.error().text;
    ASSERT_TRUE(id->solution.synchronisation);
    EXPECT_EQ(id->solution.synchronisation->sigma_factor, 1.0);
  }
}

TEST(SynchronisedEstimate, IsAcceptedByTheGate) {
  const EncoderRun run = encoder_run(3, Estimator::Simultaneous);
  const auto& id = identified_with_readings(3, Estimator::Simultaneous);
  ASSERT_TRUE(id) << id.error().text;
  const auto verdict = judge(id->observations, id->solution, nullptr, {}, run.run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  EXPECT_LT(verdict->held_out.candidate, 1.1);
}

/// Mean error of V at the nodes.
double mean_error_m(const MadeRun& run, const VolumetricModel& model) {
  return vector_statistics(errors_left(run, model)).mean_m;
}

/// Known clock, 10 us of jitter at 0.1 m/s: 1 um along the travel.
TEST(SynchronisedEstimate, OfATriggerLineHasASmallerError) {
  double across_m2 = 0.0, all_m2 = 0.0;
  for (unsigned seed = 1; seed <= abbe::tests::repetitions(4u); ++seed) {
    EncoderRun run = make_encoder_run(
        {.seed = seed, .sigma_time_s = 10e-6, .stated_sigma_time_s = 10e-6, .speed_m_s = 0.1});
    run.run.options.estimator = Estimator::Simultaneous;
    run.run.options.segment_samples = 40;
    run.log.known_clock = run.clock;
    const MadeRun& r = run.run;
    const auto across = identify(r.samples, r.machine, r.path, r.noise, r.options);
    const auto all = identify_with_readings(run);
    ASSERT_TRUE(across && all) << all.error().text;
    EXPECT_EQ(all->solution.clock.size(), 0);
    EXPECT_EQ(all->solution.synchronisation->u_offset_s, 0.0);
    across_m2 += std::pow(mean_error_m(r, across->solution.model), 2);
    all_m2 += std::pow(mean_error_m(r, all->solution.model), 2);
  }
  const double ratio = std::sqrt(all_m2 / across_m2);
  RecordProperty("error_relative_to_the_run_without", std::to_string(ratio));
  if (abbe::tests::kAllRepetitions) {
    EXPECT_LT(ratio, 0.9);
  }
}

}  // namespace
