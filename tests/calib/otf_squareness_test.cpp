/// Squareness, and the slopes of straightness tables that are squareness: the sign of each alone.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <string>

#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

constexpr double kSlope = 20e-6;

/// A slope of one straightness table, without a rigid motion, is a squareness error of this sign:
///     EXY: V_x = s y   = -EC0Y y     EYX: V_y = s x, turned by -s about Z: V_x = s y
///     EXZ: V_x = s z   =  EB0Z z     EZX: V_z = s x, turned by  s about Y: V_x = s z
///     EYZ: V_y = s z   = -EA0Z z     EZY: V_z = s y, turned by -s about X: V_y = s z
struct SlopeTerm {
  const char* table;
  std::size_t squareness;  ///< index in kSquarenessNames
  double sign;
};
constexpr std::array<SlopeTerm, 6> kTerms{{{"EXY", 2, -1.0},
                                           {"EYX", 2, -1.0},
                                           {"EXZ", 1, 1.0},
                                           {"EZX", 1, 1.0},
                                           {"EYZ", 0, -1.0},
                                           {"EZY", 0, -1.0}}};

class SlopeIsSquareness : public testing::TestWithParam<std::tuple<SlopeTerm, Estimator>> {};
INSTANTIATE_TEST_SUITE_P(OtfTerms, SlopeIsSquareness,
                         testing::Combine(testing::ValuesIn(kTerms),
                                          testing::Values(Estimator::TwoStep,
                                                          Estimator::Simultaneous)));

/// A machine whose only error is a slope of one table.
MadeRun run_with_slope(const std::string& name) {
  const MadeRunOptions made{.noise_factor = 0.0, .error_scale_m = 0.0, .speed_m_s = 0.8};
  MadeRun run = make_run(made);
  const ParameterLayout layout = layout_of(run.machine);
  for (const Table& table : layout.tables()) {
    const std::vector<double>& nodes_m = run.machine.nodes[index(table.motion.axis)].nodes_m;
    for (std::size_t i = 0; abbe::calib::name(table.motion) == name && i < nodes_m.size(); ++i) {
      run.truth(static_cast<Eigen::Index>(table.offset + i)) = kSlope * nodes_m[i];
    }
  }
  measure_run(run, made);
  return run;
}

TEST_P(SlopeIsSquareness, WithItsSign) {
  const auto& [term, estimator] = GetParam();
  MadeRun run = run_with_slope(term.table);
  run.options.estimator = estimator;
  run.options.segment_samples = 5;  // 16 mm
  const auto found = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(found) << found.error().text;
  const VolumetricModel& model = found->solution.model;
  const std::size_t first = model.tables()->layout().squareness_offset();
  for (std::size_t k = 0; k < kSquarenessNames.size(); ++k) {
    const double expected = k == term.squareness ? term.sign * kSlope : 0.0;
    // the second order of the slope is 4e-10
    EXPECT_NEAR(model.U()(static_cast<Eigen::Index>(first + k)), expected, 2e-9)
        << kSquarenessNames[k] << " of " << term.table;
  }
  EXPECT_LT(model.U().head(static_cast<Eigen::Index>(first)).cwiseAbs().maxCoeff(), 2e-9)
      << "the tables have no slope of their own in datum G1";
}

class SquarenessAlone : public testing::TestWithParam<std::tuple<std::size_t, Estimator>> {};
INSTANTIATE_TEST_SUITE_P(OtfTerms, SquarenessAlone,
                         testing::Combine(testing::Values(0u, 1u, 2u),
                                          testing::Values(Estimator::TwoStep,
                                                          Estimator::Simultaneous)));

TEST_P(SquarenessAlone, IsRecovered) {
  const auto [which, estimator] = GetParam();
  const MadeRunOptions made{.noise_factor = 0.0, .error_scale_m = 0.0, .speed_m_s = 0.8};
  MadeRun run = make_run(made);
  const auto at = static_cast<Eigen::Index>(layout_of(run.machine).squareness_offset() + which);
  run.truth(at) = kSlope;
  measure_run(run, made);
  run.options.estimator = estimator;
  run.options.segment_samples = 5;  // 16 mm
  const auto found = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(found) << found.error().text;
  Eigen::VectorXd rest = found->solution.model.U();
  EXPECT_NEAR(rest(at), kSlope, 2e-9);
  rest(at) = 0.0;
  EXPECT_LT(rest.cwiseAbs().maxCoeff(), 2e-9);
}

}  // namespace
