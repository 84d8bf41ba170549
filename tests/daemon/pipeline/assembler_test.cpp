#include "abbe/pipeline/assembler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::AxisSample;
using protocol::HostTime;
using protocol::SampleFlag;
using protocol::Snapshot;
using protocol::TrackerPoint;

constexpr HostTime kStart{100s};

// The machine of these tests: X moves with constant acceleration, Y and Z stand.
double x_at(HostTime t) {
  const double s = std::chrono::duration<double>(t - kStart).count();
  return 0.01 * s + 0.5 * s * s;
}

AxisSample axes_at(HostTime t) {
  AxisSample a;
  a.head.time = t;
  a.axis_count = 3;
  a.position = {x_at(t), 0.2, -0.3};
  return a;
}

TrackerPoint point_at(HostTime t) {
  TrackerPoint p;
  p.head.time = t;
  p.p_tracker_m = {x_at(t), 0.0, 0.0};
  return p;
}

Batch axes_batch(HostTime from, HostTime to) {
  Batch b;
  for (HostTime t = from; t < to; t += 1ms) b.axes.push_back(axes_at(t));
  return b;
}

Batch burst(HostTime from, int points) {
  Batch b;
  for (int i = 0; i < points; ++i) b.points.push_back(point_at(from + i * 2ms + 300us));
  return b;
}

TEST(Assembler, PutsTheAxesWhereTheTrackerPointIs) {
  Assembler assembler{{}};
  assembler.take(axes_batch(kStart, kStart + 400ms));
  assembler.take(burst(kStart + 10ms, 166));
  std::vector<Snapshot> out;
  assembler.emit(out);
  ASSERT_EQ(out.size(), 166u);
  for (const Snapshot& s : out) {
    // A cubic through samples of a parabola is that parabola, except for rounding.
    EXPECT_NEAR(s.position[0], x_at(s.head.time), 1e-12);
    EXPECT_TRUE(s.has_tracker_point);
  }
}

TEST(Assembler, APointFromTheFutureDelaysAndInvalidatesNoOther) {
  Assembler assembler{{}};
  auto batch = axes_batch(kStart, kStart + 400ms);
  batch.points = {point_at(kStart + 10ms), point_at(kStart + 1h), point_at(kStart + 12ms)};
  batch.taken = kStart + 400ms;
  assembler.take(batch);
  std::vector<Snapshot> out;
  assembler.emit(out);
  auto later = axes_batch(kStart + 400ms, kStart + 900ms);
  later.points = {point_at(kStart + 500ms)};
  later.taken = kStart + 900ms;
  assembler.take(later);
  assembler.emit(out);
  ASSERT_EQ(out.size(), 4u);
  for (std::size_t i = 0; i < out.size(); ++i)
    EXPECT_EQ(has(out[i].head.flags, SampleFlag::AxisMissing), i == 1) << i;
}

TEST(Assembler, TheOrderOfArrivalChangesNothing) {
  std::vector<Snapshot> early_axes;
  std::vector<Snapshot> late_axes;
  Assembler first{{}};
  first.take(axes_batch(kStart, kStart + 1s));
  for (int b = 0; b < 2; ++b) first.take(burst(kStart + 20ms + b * 332ms, 166));
  first.emit(early_axes);

  Assembler second{{}};
  for (int b = 0; b < 2; ++b) {
    second.take(burst(kStart + 20ms + b * 332ms, 166));
    second.emit(late_axes);
    second.take(axes_batch(kStart + b * 500ms, kStart + (b + 1) * 500ms));
    second.emit(late_axes);
  }
  ASSERT_EQ(early_axes.size(), 332u);
  ASSERT_EQ(late_axes.size(), early_axes.size());
  for (std::size_t i = 0; i < early_axes.size(); ++i) {
    EXPECT_EQ(late_axes[i].head.time, early_axes[i].head.time);
    EXPECT_EQ(late_axes[i].position, early_axes[i].position);
    EXPECT_EQ(late_axes[i].u_position, early_axes[i].u_position);
  }
}

TEST(Assembler, AnAxisSampleThatComesLateChangesNothing) {
  Batch in_order = axes_batch(kStart, kStart + 50ms);
  in_order.axes[20].head.time += 300us;  // bus-off is reported between two SYNCs
  in_order.axes[20].missing_mask = 0b111;
  Batch out_of_order = in_order;
  std::swap(out_of_order.axes[20], out_of_order.axes[21]);
  std::vector<std::vector<Snapshot>> results;

  for (const Batch& axes : {in_order, out_of_order}) {
    Assembler assembler{{}};
    assembler.take(axes);
    assembler.take(burst(kStart + 4ms, 20));
    assembler.emit(results.emplace_back());
  }

  ASSERT_EQ(results[0].size(), 20u);
  ASSERT_EQ(results[1].size(), 20u);
  for (std::size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(results[0][i].position, results[1][i].position) << i;
    EXPECT_EQ(results[0][i].missing_mask, results[1][i].missing_mask) << i;
  }
}

TEST(Assembler, WaitsForAxesUntilTheWatermark) {
  Assembler assembler{{.watermark = 600ms}};
  std::vector<Snapshot> out;
  assembler.take(burst(kStart, 166));
  assembler.emit(out);
  EXPECT_TRUE(out.empty());
  assembler.take(burst(kStart + 700ms, 166));
  assembler.emit(out);
  ASSERT_FALSE(out.empty());
  EXPECT_TRUE(has(out.front().head.flags, SampleFlag::AxisMissing));
  EXPECT_EQ(out.front().axis_count, 0);
}

TEST(Assembler, DoesNotInterpolateAcrossAGap) {
  Assembler assembler{{}};
  assembler.take(axes_batch(kStart, kStart + 50ms));
  assembler.take(axes_batch(kStart + 90ms, kStart + 200ms));
  assembler.take(burst(kStart + 60ms, 1));
  std::vector<Snapshot> out;
  assembler.emit(out);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_TRUE(has(out.front().head.flags, SampleFlag::AxisMissing));
}

TEST(Assembler, EmitsTheRemainingSnapshotsAtTheEnd) {
  Assembler assembler{{}};
  assembler.take(axes_batch(kStart, kStart + 100ms));
  assembler.take(burst(kStart + 90ms, 20));
  std::vector<Snapshot> out;
  assembler.finish(out);
  EXPECT_EQ(out.size(), 20u);
}

protocol::ProbeTrigger touch_at(HostTime t) {
  protocol::ProbeTrigger touch;
  touch.head.time = t;
  touch.touch = 1;
  return touch;
}

TEST(Assembler, ATouchWithItsOwnAxisPositionsKeepsThem) {
  Assembler assembler{{}};
  assembler.take(axes_batch(kStart, kStart + 100ms));
  Batch batch;
  batch.touches.push_back(touch_at(kStart + 50ms));
  batch.touches[0].axis_count = 3;
  batch.touches[0].position = {1.0, 2.0, 3.0};
  batch.touches[0].u_position = {1e-9, 1e-9, 1e-9};
  assembler.take(batch);
  std::vector<Snapshot> out;
  assembler.emit(out);

  ASSERT_EQ(out.size(), 1u);
  EXPECT_TRUE(out[0].has_trigger);
  EXPECT_FALSE(out[0].has_tracker_point);
  EXPECT_EQ(out[0].trigger.touch, 1u);
  EXPECT_EQ(out[0].position, batch.touches[0].position);
  EXPECT_EQ(out[0].u_position[2], 1e-9);
}

TEST(Assembler, ATouchWithoutAxisPositionsGetsThoseOfItsInstant) {
  Assembler assembler{{}};
  assembler.take(axes_batch(kStart, kStart + 100ms));
  Batch batch;
  batch.touches.push_back(touch_at(kStart + 50ms + 300us));
  assembler.take(batch);
  std::vector<Snapshot> out;
  assembler.emit(out);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_NEAR(out[0].position[0], x_at(out[0].head.time), 1e-12);
}

TEST(Assembler, ATouchBeforeAPointLeavesThePointItsEnvironment) {
  Assembler assembler{{}};
  Batch batch = axes_batch(kStart, kStart + 1s);
  for (const auto at : {0ms, 500ms}) {
    protocol::EnvironmentSample e;
    e.head.time = kStart + at;
    e.air_temperature_K = 290.0 + std::chrono::duration<double>(at).count();
    batch.environment.push_back(e);
  }

  batch.touches.push_back(touch_at(kStart + 800ms));
  assembler.take(batch);
  std::vector<Snapshot> out;
  assembler.emit(out);
  assembler.take(burst(kStart + 100ms, 1));
  assembler.emit(out);

  ASSERT_EQ(out.size(), 2u);
  EXPECT_EQ(out[0].environment.air_temperature_K, 290.5);
  EXPECT_EQ(out[1].environment.air_temperature_K, 290.0);
}

}  // namespace
}  // namespace abbe::daemon
