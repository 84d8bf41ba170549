/// The choice among candidate positions, indexing by rotary axes, and the duration.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "abbe/calib/mfb/plan/plan_indexing.hpp"
#include "mfb_planning.hpp"

namespace abbe::calib::mfb {
namespace {

using tests::mfb::paper_task;
using tests::mfb::task_for;

std::size_t styli_in(const std::vector<PlannedPosition>& positions) {
  return PlannedSet{positions, {}, {}}.measurements();
}

/// Six holes on a machine as long as the bar: quick.
PlanTask small_task() {
  return task_for(6, Vector3::Constant(0.25), 0.05);
}

/// Throws if the set is refused.
std::vector<PlannedPosition> positions_of(NamedSet which, const PlanTask& task) {
  return named_set(which, task).value().positions;
}

TEST(MfbPlanChoice, IsBetterThanTheNamedSetWithAsManyMeasurements) {
  const PlanTask task = small_task();
  for (const NamedSet which : {NamedSet::Paper, NamedSet::Minimum}) {
    const auto start = positions_of(which, task);
    const auto chosen = choose_set(task, start);
    ASSERT_TRUE(chosen) << chosen.error().text;
    EXPECT_LT(chosen->prediction.worst, chosen->start.worst);
    EXPECT_EQ(chosen->positions.size(), start.size());
    EXPECT_EQ(styli_in(chosen->positions), styli_in(start));

    const Plan plan = plan_of(task, chosen->positions);
    ASSERT_TRUE(check(plan, task.bar)) << check(plan, task.bar).error().text;
    const auto again = predict(task.bar, plan, task.machine);
    ASSERT_TRUE(again) << again.error().text;
    EXPECT_NEAR(again->worst, chosen->prediction.worst, 1e-9);
  }
}

TEST(MfbPlanChoice, IsTheStartWhereNothingMayBeExchanged) {
  const PlanTask task = small_task();
  const auto start = positions_of(NamedSet::Minimum, task);
  ChoiceOptions options;
  options.exchanges = 0;
  const auto chosen = choose_set(task, start, options);
  ASSERT_TRUE(chosen) << chosen.error().text;
  EXPECT_EQ(chosen->exchanged, 0u);
  EXPECT_EQ(chosen->prediction.worst, chosen->start.worst);
  EXPECT_EQ(chosen->positions.front().name, start.front().name);
}

TEST(MfbPlanChoice, StopsWhenItIsAsked) {
  const PlanTask task = small_task();
  ChoiceOptions options;
  options.stopped = [] { return true; };
  const auto chosen = choose_set(task, positions_of(NamedSet::Minimum, task), options);
  ASSERT_FALSE(chosen);
  EXPECT_EQ(chosen.error().code, ErrorCode::NotConverged);
}

Matrix3 turned(const Vector3& axis, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
}

TEST(MfbPlanIndexing, TwoRotaryAxesNeedSixClampings) {
  const PlanTask task = paper_task();
  const auto positions = positions_of(NamedSet::Indexed, task);
  EXPECT_EQ(positions.size(), 14u);
  for (const Axis swivel : {Axis::X, Axis::Y}) {
    const auto indexed = indexed_positions(positions, task.bar, {middle_of_travel(task), swivel});
    EXPECT_EQ(clampings_of(indexed), 6u) << letter(swivel);
  }
}

TEST(MfbPlanIndexing, PositionsOfOneClampingLieOnTheSamePlaceOfTheTable) {
  const PlanTask task = paper_task();
  const RotaryTable table{middle_of_travel(task), Axis::X};
  const auto positions = positions_of(NamedSet::Indexed, task);
  const auto indexed = indexed_positions(positions, task.bar, table);
  std::map<std::size_t, BarPose> clamped;
  for (std::size_t i = 0; i < indexed.size(); ++i) {
    EXPECT_LE(std::abs(indexed[i].swivel_rad), table.max_swivel_rad);
    const Matrix3 R = turned(Vector3::UnitX(), indexed[i].swivel_rad) *
                      turned(Vector3::UnitZ(), indexed[i].turn_rad);
    const BarPose& pose = positions[i].pose;
    const BarPose on_table{R.transpose() * (pose.origin_m - table.centre_m),
                           R.transpose() * pose.axes};
    const auto [first, is_new] = clamped.try_emplace(indexed[i].clamping, on_table);
    EXPECT_LE((first->second.origin_m - on_table.origin_m).norm(), 1e-3);
    EXPECT_LE((first->second.axes - on_table.axes).norm(), 1e-6);
  }
}

TEST(MfbPlanIndexing, ASwivelAxisThatDoesNotMoveNeedsMoreClampings) {
  const PlanTask task = paper_task();
  const auto positions = positions_of(NamedSet::Indexed, task);
  RotaryTable table{middle_of_travel(task), Axis::X};
  table.min_swivel_rad = table.max_swivel_rad = 0.0;
  EXPECT_GT(clampings_of(indexed_positions(positions, task.bar, table)), 6u);
}

TEST(MfbPlanDuration, GrowsWithThePassesAndFallsWithTheFeed) {
  PlanTask task = paper_task();
  const auto positions = positions_of(NamedSet::Rolled, task);
  const double forward_s = duration_s(task.bar, plan_of(task, positions), {});
  task.backward = true;
  const Plan plan = plan_of(task, positions);
  EXPECT_NEAR(duration_s(task.bar, plan, {}), 2.0 * forward_s, 1e-9);

  // 34 passes of 316 touches, 3 mm to the surface and back at 4 mm/s: the least.
  const double touching_s = 34 * 316 * 2 * 3e-3 / 4e-3;
  EXPECT_GT(duration_s(task.bar, plan, {}), touching_s);
  TouchDrive fast;
  fast.feed_m_per_s = 1e6;
  EXPECT_NEAR(duration_s(task.bar, plan, fast), touching_s, 1e-2);
}

}  // namespace
}  // namespace abbe::calib::mfb
