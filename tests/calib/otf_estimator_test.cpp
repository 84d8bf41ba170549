#include "abbe/calib/internal/otf/solve/simultaneous.hpp"

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

class SimultaneousEstimate : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Chains, SimultaneousEstimate,
                         testing::Values("[w X' b Y Z t]", "[w b Z Y X t]", "[w Y' b X Z t]"));

// Errors of 0.1 mm, exact samples: the linear adjustment is wrong by the second order, 0.1 mm times
// the slope of the errors.
TEST_P(SimultaneousEstimate, HasNoErrorOfTheSecondOrder) {
  const MadeRun run = make_run(
      {.noise_factor = 0.0, .error_scale_m = 100e-6, .in_datum = true, .chain = GetParam()});
  const auto two_step = identified(run, Estimator::TwoStep);
  const auto simultaneous = identified(run, Estimator::Simultaneous);
  ASSERT_TRUE(two_step && simultaneous) << simultaneous.error().text;
  EXPECT_GT(largest_error_m(run, two_step->solution.model), 10e-9);
  EXPECT_LT(largest_error_m(run, simultaneous->solution.model), 1e-9);
  EXPECT_LE(simultaneous->solution.statistics.iterations, 4);
}

TEST(SimultaneousEstimate, LeavesNoRigidMotion) {
  const auto simultaneous =
      identified(make_run({.error_scale_m = 100e-6}), Estimator::Simultaneous);
  ASSERT_TRUE(simultaneous) << simultaneous.error().text;
  EXPECT_LT(simultaneous->solution.rigid.cwiseAbs().maxCoeff(), 1e-10);
  const Matrix3& R = simultaneous->solution.T_machine_tracker.R;
  EXPECT_LT((R * R.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(SimultaneousEstimate, StatesTheUncertaintyOfTwoStepForWhiteNoise) {
  const MadeRun run = make_run({.seed = 4});
  const auto two_step = identified(run, Estimator::TwoStep);
  const auto simultaneous = identified(run, Estimator::Simultaneous);
  ASSERT_TRUE(two_step && simultaneous);
  EXPECT_EQ(simultaneous->solution.statistics.variance_factor, 1.0);
  EXPECT_EQ(simultaneous->solution.statistics.rank, two_step->solution.statistics.rank);
  EXPECT_TRUE(simultaneous->solution.model.covariance().isApprox(
      two_step->solution.model.covariance(), 1e-3));
}

TEST(SimultaneousEstimate, IsJudgedOnItsOwnObservations) {
  MadeRun run = make_run({.seed = 4});
  const auto simultaneous = identified(run, Estimator::Simultaneous);
  ASSERT_TRUE(simultaneous);
  const auto verdict =
      judge(simultaneous->observations, simultaneous->solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  EXPECT_LT(verdict->held_out.candidate, 1.1);
}

TEST(SimultaneousEstimate, IsNamedInItsSolution) {
  const MadeRun run = make_run({});
  const auto two_step = identified(run, Estimator::TwoStep);
  const auto simultaneous = identified(run, Estimator::Simultaneous);
  ASSERT_TRUE(two_step && simultaneous);
  EXPECT_EQ(name(two_step->solution.estimator), "two-step");
  EXPECT_EQ(stop_reason(two_step->solution.estimator), "direct");
  EXPECT_EQ(name(simultaneous->solution.estimator), "simultaneous");
  EXPECT_EQ(stop_reason(simultaneous->solution.estimator), "converged");
  EXPECT_EQ(estimator("simultaneous"), Estimator::Simultaneous);
  EXPECT_FALSE(estimator("one-shot"));
}

TEST(SimultaneousEstimate, ReportsThatItDidNotConverge) {
  MadeRun run = make_run({.error_scale_m = 100e-6});
  run.options.max_adjustments = 1;
  const auto simultaneous = identified(run, Estimator::Simultaneous);
  ASSERT_FALSE(simultaneous);
  EXPECT_EQ(simultaneous.error().code, ErrorCode::NotConverged);
  EXPECT_THAT(simultaneous.error().text, HasSubstr("no convergence after 1 adjustments"));
}

TEST(SimultaneousEstimate, NamesNodesWithoutData) {
  MadeRun run = make_run({});
  run.machine.nodes[0].nodes_m.push_back(1.3);  // far beyond the path
  const auto simultaneous = identified(run, Estimator::Simultaneous);
  ASSERT_FALSE(simultaneous);
  EXPECT_EQ(simultaneous.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(simultaneous.error().text, HasSubstr("EXX at +1.300 m"));
}

TEST(SimultaneousEstimate, EndsWhenItIsStoppedWhereverItIs) {
  MadeRun run = make_run({});
  int asked = 0, stop_at = -1;
  run.options.stopped = [&] { return asked++ == stop_at; };
  ASSERT_TRUE(identified(run, Estimator::Simultaneous));
  const int looks = asked;

  for (const int at : {0, looks / 2, looks - 2, looks - 1}) {
    asked = 0;
    stop_at = at;
    const auto simultaneous = identified(run, Estimator::Simultaneous);
    ASSERT_FALSE(simultaneous) << at;
    EXPECT_THAT(simultaneous.error().text, HasSubstr("stopped before its end")) << at;
  }
}

TEST(SimultaneousEstimate, ReportsProgressThatAscendsWithinAStage) {
  MadeRun run = make_run({});
  std::vector<std::pair<Stage, double>> reports;
  run.options.progress = [&](Stage stage, double fraction) {
    reports.emplace_back(stage, fraction);
  };
  ASSERT_TRUE(identified(run, Estimator::Simultaneous));
  for (std::size_t i = 1; i < reports.size(); ++i) {
    EXPECT_TRUE(reports[i].first != reports[i - 1].first ||
                reports[i].second >= reports[i - 1].second)
        << i;
  }
  EXPECT_EQ(reports.back(), std::pair(Stage::Solve, 1.0));
}

TEST(SimultaneousEstimate, OfTwoStepIsTheLinearAdjustmentBitForBit) {
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
