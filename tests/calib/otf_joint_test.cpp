#include "abbe/calib/internal/otf/solve/joint.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "abbe/calib/internal/otf/identify/observe_run.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;

Result<Identification> identified(MadeRun run, Estimator estimator) {
  run.options.estimator = estimator;
  return identify(run.samples, run.machine, run.path, run.noise, run.options);
}

double largest_error_m(const MadeRun& run, const VolumetricModel& model) {
  std::vector<Vector3> points = tensor_grid(run.machine.nodes);
  for (Vector3& p : points) {
    p += run.machine.target_offset_m;
  }
  return rigid_free(points, errors_left(run, model))->rigid_free.max_m;
}

class JointEstimate : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Chains, JointEstimate,
                         testing::Values("[w X' b Y Z t]", "[w b Z Y X t]", "[w Y' b X Z t]"));

// Errors of 0.1 mm, exact samples: the linear adjustment is wrong by the second order, 0.1 mm times
// the slope of the errors.
TEST_P(JointEstimate, HasNoErrorOfTheSecondOrder) {
  const MadeRun run = make_run(
      {.noise_factor = 0.0, .error_scale_m = 100e-6, .in_gauge = true, .chain = GetParam()});
  const auto two_step = identified(run, Estimator::TwoStep);
  const auto joint = identified(run, Estimator::Joint);
  ASSERT_TRUE(two_step && joint) << joint.error().text;
  EXPECT_GT(largest_error_m(run, two_step->solution.model), 10e-9);
  EXPECT_LT(largest_error_m(run, joint->solution.model), 1e-9);
  EXPECT_LE(joint->solution.statistics.iterations, 4);
}

TEST(JointEstimate, LeavesNoRigidMotion) {
  const auto joint = identified(make_run({.error_scale_m = 100e-6}), Estimator::Joint);
  ASSERT_TRUE(joint) << joint.error().text;
  EXPECT_LT(joint->solution.rigid.cwiseAbs().maxCoeff(), 1e-10);
  const Matrix3& R = joint->solution.T_machine_tracker.R;
  EXPECT_LT((R * R.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(JointEstimate, StatesTheUncertaintyOfTwoStepForWhiteNoise) {
  const MadeRun run = make_run({.seed = 4});
  const auto two_step = identified(run, Estimator::TwoStep);
  const auto joint = identified(run, Estimator::Joint);
  ASSERT_TRUE(two_step && joint);
  EXPECT_EQ(joint->solution.statistics.variance_factor, 1.0);
  EXPECT_EQ(joint->solution.statistics.rank, two_step->solution.statistics.rank);
  EXPECT_TRUE(
      joint->solution.model.covariance().isApprox(two_step->solution.model.covariance(), 1e-3));
}

TEST(JointEstimate, IsJudgedOnItsOwnObservations) {
  MadeRun run = make_run({.seed = 4});
  const auto joint = identified(run, Estimator::Joint);
  ASSERT_TRUE(joint);
  const auto verdict = judge(joint->observations, joint->solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  EXPECT_LT(verdict->held_out.candidate, 1.1);
}

TEST(JointEstimate, IsNamedInItsSolution) {
  const MadeRun run = make_run({});
  const auto two_step = identified(run, Estimator::TwoStep);
  const auto joint = identified(run, Estimator::Joint);
  ASSERT_TRUE(two_step && joint);
  EXPECT_EQ(name(two_step->solution.estimator), "two-step");
  EXPECT_EQ(stop_reason(two_step->solution.estimator), "direct");
  EXPECT_EQ(name(joint->solution.estimator), "joint");
  EXPECT_EQ(stop_reason(joint->solution.estimator), "converged");
  EXPECT_EQ(estimator("joint"), Estimator::Joint);
  EXPECT_FALSE(estimator("one-shot"));
}

TEST(JointEstimate, ReportsThatItDidNotConverge) {
  MadeRun run = make_run({.error_scale_m = 100e-6});
  run.options.max_adjustments = 1;
  const auto joint = identified(run, Estimator::Joint);
  ASSERT_FALSE(joint);
  EXPECT_EQ(joint.error().code, ErrorCode::NotConverged);
  EXPECT_THAT(joint.error().text, HasSubstr("no convergence after 1 adjustments"));
}

TEST(JointEstimate, NamesNodesWithoutData) {
  MadeRun run = make_run({});
  run.machine.nodes[0].nodes_m.push_back(1.3);  // far beyond the path
  const auto joint = identified(run, Estimator::Joint);
  ASSERT_FALSE(joint);
  EXPECT_EQ(joint.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(joint.error().text, HasSubstr("EXX at +1.300 m"));
}

TEST(JointEstimate, EndsWhenItIsStoppedWhereverItIs) {
  MadeRun run = make_run({});
  int asked = 0, stop_at = -1;
  run.options.stopped = [&] { return asked++ == stop_at; };
  ASSERT_TRUE(identified(run, Estimator::Joint));
  const int looks = asked;

  for (const int at : {0, looks / 2, looks - 2, looks - 1}) {
    asked = 0;
    stop_at = at;
    const auto joint = identified(run, Estimator::Joint);
    ASSERT_FALSE(joint) << at;
    EXPECT_THAT(joint.error().text, HasSubstr("stopped before its end")) << at;
  }
}

TEST(JointEstimate, ReportsProgressThatAscendsWithinAStage) {
  MadeRun run = make_run({});
  std::vector<std::pair<Stage, double>> reports;
  run.options.progress = [&](Stage stage, double fraction) {
    reports.emplace_back(stage, fraction);
  };
  ASSERT_TRUE(identified(run, Estimator::Joint));
  for (std::size_t i = 1; i < reports.size(); ++i) {
    EXPECT_TRUE(reports[i].first != reports[i - 1].first ||
                reports[i].second >= reports[i - 1].second)
        << i;
  }
  EXPECT_EQ(reports.back(), std::pair(Stage::Solve, 1.0));
}

TEST(JointEstimate, OfTwoStepIsTheLinearAdjustmentBitForBit) {
  const MadeRun run = make_run({.seed = 5});
  const auto whole = identified(run, Estimator::TwoStep);
  const auto o = observe(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(whole && o);
  const auto by_steps = solve(*o, run.options);
  ASSERT_TRUE(by_steps);
  EXPECT_EQ(whole->solution.model.U(), by_steps->model.U());
  EXPECT_EQ(whole->solution.model.covariance(), by_steps->model.covariance());
}

}  // namespace
