/// Planned paths, for a machine with few nodes; `scripts/bench plan_otf` plans for the reference
/// machine.
#include "abbe/calib/otf/plan/plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/otf/plan/plan_observable.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;

PlannedRun few_nodes() {
  return {.machine = coarse_machine("[w X' b Y Z (C1) t]"), .tracker_m = {-0.75, -0.62, -0.35}};
}

const PlanOptions kWalk{.lattice = 3, .exchanges = 0};
constexpr double kLength_m = 14.0;

double rms_um(const Path& path, const PlannedRun& run = few_nodes()) {
  const auto p = predict(path, run);
  return p ? 1e6 * p->rms_u_m : std::nan("");
}

/// Paths of kLength_m, planned once.
const Result<PlannedPath>& walked() {
  static const Result<PlannedPath> planned = plan(few_nodes(), {.length_m = kLength_m}, kWalk);
  return planned;
}
const Result<PlannedPath>& exchanged() {
  static const Result<PlannedPath> planned =
      plan(few_nodes(), {.length_m = kLength_m}, {.lattice = 3, .exchanges = 300});
  return planned;
}

TEST(OtfPlan, IsBetterThanTheBasePathAndNoLongerThanItsBudget) {
  const Path base = base_path(few_nodes().machine.nodes);
  const auto& planned = walked();
  ASSERT_TRUE(planned) << planned.error().text;
  const double length_m = lengths_to_vertices_m(planned->path).back();
  EXPECT_LE(length_m, kLength_m);
  EXPECT_EQ(planned->corners_not_reached, 0u);

  // Noise decreases with the root of the length.
  const double base_m = lengths_to_vertices_m(base).back();
  EXPECT_LT(rms_um(planned->path) * std::sqrt(length_m), rms_um(base) * std::sqrt(base_m));
  EXPECT_TRUE(check(planned->path, few_nodes().machine.nodes));
}

TEST(OtfPlan, GivesThePathFoundSoFarWhenThatIsEnough) {
  PlanOptions options{.lattice = 3, .exchanges = 300};
  std::size_t reports = 0;
  options.progress = [&reports](double, double) { ++reports; };
  options.enough = [&reports] { return reports >= 2; };
  const auto planned = plan(few_nodes(), {.length_m = kLength_m}, options);
  ASSERT_TRUE(planned) << planned.error().text;
  EXPECT_TRUE(planned->ended_early);
  EXPECT_FALSE(exchanged()->ended_early);
  EXPECT_LT(planned->rms_u_m, planned->walk_rms_u_m);
  EXPECT_GT(planned->rms_u_m, exchanged()->rms_u_m);

  options.enough = [] { return true; };
  const auto at_once = plan(few_nodes(), {.length_m = kLength_m}, options);
  ASSERT_TRUE(at_once) << at_once.error().text;
  EXPECT_TRUE(at_once->ended_early);
  EXPECT_NEAR(at_once->rms_u_m, walked()->rms_u_m, 0.02 * walked()->rms_u_m);
}

TEST(OtfPlan, EstimateIsThePredictedUncertainty) {
  const auto& planned = walked();
  ASSERT_TRUE(planned) << planned.error().text;
  EXPECT_NEAR(1e6 * planned->rms_u_m, rms_um(planned->path), 0.02 * rms_um(planned->path));
}

/// Legs that look alike from the tracker do not show the offset.
TEST(OtfPlan, DeterminesAnOffsetOfTheRanges) {
  PlannedRun run = few_nodes();
  run.noise.u_range_offset_m = 50e-6;
  const auto with = plan(run, {.length_m = kLength_m}, {.lattice = 3, .exchanges = 300});
  const auto& without = exchanged();
  ASSERT_TRUE(with && without);
  EXPECT_NEAR(1e6 * with->rms_u_m, rms_um(with->path, run), 0.02 * rms_um(with->path, run));
  EXPECT_LT(rms_um(with->path, run), rms_um(without->path, run));
}

TEST(OtfPlan, IsImprovedAfterTheWalk) {
  const auto &walk = walked(), &improved = exchanged();
  ASSERT_TRUE(walk && improved);
  EXPECT_LT(improved->rms_u_m, walk->rms_u_m);
  EXPECT_LE(lengths_to_vertices_m(improved->path).back(), kLength_m);
}

TEST(OtfPlan, IsTheSameEveryTime) {
  const auto& once = walked();
  const auto again = plan(few_nodes(), {.length_m = kLength_m}, kWalk);
  ASSERT_TRUE(once && again);
  EXPECT_EQ(once->path.vertices_m, again->path.vertices_m);
}

TEST(OtfPlan, KeepsABudgetOfTime) {
  PlannedRun run = few_nodes();
  run.drive.dwell_s = 1.0;
  const auto planned = plan(run, {.duration_s = 300.0}, kWalk);
  ASSERT_TRUE(planned) << planned.error().text;
  EXPECT_LE(duration_s(planned->path, run.drive), 300.0);
  EXPECT_GT(duration_s(planned->path, run.drive), 270.0);
}

TEST(OtfPlan, StatesTheLengthThatAShortBudgetLacks) {
  const auto refused = plan(few_nodes(), {.length_m = 1.0}, kWalk);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
  EXPECT_THAT(refused.error().text, HasSubstr("a path that determines the model needs about"));
}

TEST(OtfPlan, NeedsABudget) {
  EXPECT_FALSE(plan(few_nodes(), {}));
  EXPECT_FALSE(plan(few_nodes(), {.length_m = -1.0}));
  EXPECT_FALSE(plan(few_nodes(), {.length_m = 10.0}, {.lattice = 2}));
}

TEST(OtfPlan, EndsWhenItIsStopped) {
  const auto stopped =
      plan(few_nodes(), {.length_m = kLength_m}, {.lattice = 3, .stopped = [] { return true; }});
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::NotConverged);
}

}  // namespace
