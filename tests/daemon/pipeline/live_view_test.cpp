#include "abbe/pipeline/live_view.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::AxisSample;
using protocol::HostTime;
using protocol::SampleFlag;
using protocol::Snapshot;

constexpr HostTime kViewStart{100s};
const drivers::MonotonicTime kTime;

AxisSample axes_at(HostTime t, double x_m) {
  AxisSample a;
  a.head.time = t;
  a.axis_count = 4;
  a.position = {x_m, 0.2, -0.3, 1.5};
  return a;
}

Batch of(const AxisSample& sample) {
  Batch b;
  b.taken = sample.head.time;
  b.axes.push_back(sample);
  return b;
}

Batch of(const protocol::TrackerPoint& point) {
  Batch b;
  b.taken = point.head.time;
  b.points.push_back(point);
  return b;
}

TEST(LiveView, ShowsTheLatestAxesAndHowFastTheyMove) {
  LiveView live{AssemblerOptions{}, kTime};
  EXPECT_TRUE(live.take(of(axes_at(kViewStart, 0.1))));
  EXPECT_TRUE(live.take(of(axes_at(kViewStart + 1ms, 0.1001))));
  EXPECT_EQ(live.view().head.time, kViewStart + 1ms);
  EXPECT_EQ(live.view().position[0], 0.1001);
  EXPECT_NEAR(live.view().velocity[0], 0.1, 1e-9);  // 0.1 mm in 1 ms
  EXPECT_EQ(live.view().velocity[1], 0.0);
}

TEST(LiveView, DoesNotShowThePointOfATrackerThatStopped) {
  LiveView live{AssemblerOptions{}, kTime};
  protocol::TrackerPoint point;
  point.head.time = kViewStart;
  point.p_tracker_m = {1.0, 2.0, 3.0};
  live.take(of(point));
  live.take(of(axes_at(kViewStart + 1s, 0.1)));

  EXPECT_TRUE(live.view().has_tracker_point);
  live.take(of(axes_at(kViewStart + 1s + 1ms, 0.1)));
  EXPECT_FALSE(live.view().has_tracker_point);
  EXPECT_EQ(live.view().tracker_point.p_tracker_m, (std::array<double, 3>{}));
  point.head.time = kViewStart + 1500ms;
  live.take(of(point));
  EXPECT_TRUE(live.view().has_tracker_point) << "the beam is back";
}

TEST(LiveView, DoesNotShowAnOldTouch) {
  LiveView live{AssemblerOptions{}, kTime};
  Batch touch;
  touch.taken = kViewStart;
  touch.touches.emplace_back().head.time = kViewStart;
  live.take(touch);
  live.take(of(axes_at(kViewStart + 1s, 0.1)));
  EXPECT_TRUE(live.view().has_trigger);
  live.take(of(axes_at(kViewStart + 1s + 1ms, 0.1)));
  EXPECT_FALSE(live.view().has_trigger);
}

/// What an environment device reports while all others are silent.
Batch weather_at(HostTime t) {
  Batch b;
  b.taken = t;
  b.measured_environment.emplace_back().sample.head.time = t;
  return b;
}

TEST(LiveView, ExpiresValuesByTheClockWhileOnlyTheEnvironmentReports) {
  LiveView live{AssemblerOptions{}, kTime};
  live.take(of(axes_at(kViewStart, 0.1)));
  protocol::TrackerPoint point;
  point.head.time = kViewStart;
  live.take(of(point));
  live.take(weather_at(kViewStart + 500ms));

  EXPECT_EQ(live.view().missing_mask, 0);
  live.take(weather_at(kViewStart + 501ms));
  EXPECT_EQ(live.view().missing_mask, 0b1111);
  EXPECT_TRUE(has(live.view().head.flags, SampleFlag::AxisMissing));
  EXPECT_FALSE(axes_known(live.view()));
  EXPECT_TRUE(live.view().has_tracker_point);
  live.take(weather_at(kViewStart + 1001ms));
  EXPECT_FALSE(live.view().has_tracker_point);
  live.take(of(axes_at(kViewStart + 2s, 0.1)));
  EXPECT_EQ(live.view().missing_mask, 0) << "the encoders are back";
}

TEST(LiveView, ReportsOnceThatTheAxesExpiredWithoutNewInput) {
  LiveView live{AssemblerOptions{}, kTime};
  live.take(of(axes_at(kViewStart, 0.1)));
  Batch nothing;
  nothing.taken = kViewStart + 500ms;
  EXPECT_FALSE(live.take(nothing));
  nothing.taken = kViewStart + 501ms;
  EXPECT_TRUE(live.take(nothing));
  EXPECT_EQ(live.view().missing_mask, 0b1111);
  EXPECT_FALSE(live.take(nothing));
}

TEST(LiveView, OfSimulatedDevicesUsesWallTime) {
  const drivers::MonotonicTime ten_times{10.0};
  LiveView live{AssemblerOptions{}, ten_times};
  live.take(of(axes_at(kViewStart, 0.1)));
  live.take(weather_at(kViewStart + 5s));
  EXPECT_EQ(live.view().missing_mask, 0);
  live.take(weather_at(kViewStart + 5001ms));
  EXPECT_EQ(live.view().missing_mask, 0b1111);
}

TEST(LiveView, ReportsThatNothingWasReceived) {
  LiveView live{AssemblerOptions{}, kTime};
  EXPECT_FALSE(live.take(Batch{}));
  EXPECT_FALSE(live.axes_known_at());
}

TEST(LiveView, ATrackerPointDoesNotMakeTheAxesYounger) {
  LiveView live{AssemblerOptions{}, kTime};
  live.take(of(axes_at(kViewStart, 0.1)));
  protocol::TrackerPoint point;
  point.head.time = kViewStart + 1s;
  EXPECT_TRUE(live.take(of(point)));
  EXPECT_EQ(live.view().head.time, kViewStart);
  EXPECT_TRUE(live.view().has_tracker_point);
}

TEST(LiveView, ShowsTheAxesOnlyWhileEachOfXyzAnswersWithoutAFault) {
  const auto missing = [](AxisSample& a) { a.missing_mask = 0b100; };
  const auto bus_off = [](AxisSample& a) { a.head.flags |= SampleFlag::BusOff; };
  const auto alarm = [](AxisSample& a) { a.head.flags |= SampleFlag::DeviceError; };

  const auto nonsense = [](AxisSample& a) {
    a.position[1] = std::numeric_limits<double>::quiet_NaN();
  };

  const auto too_few = [](AxisSample& a) { a.axis_count = 2; };
  for (void (*break_it)(AxisSample&) : {+missing, +bus_off, +alarm, +nonsense, +too_few}) {
    LiveView live{AssemblerOptions{}, kTime};
    live.take(of(axes_at(kViewStart, 0.1)));
    EXPECT_TRUE(axes_known(live.view()));
    auto broken = axes_at(kViewStart + 1ms, 0.1);
    break_it(broken);
    live.take(of(broken));
    EXPECT_FALSE(axes_known(live.view()));
    EXPECT_EQ(live.axes_known_at(), kViewStart);
  }
}

TEST(LiveView, AMissingRotaryAxisDoesNotHideXyz) {
  LiveView live{AssemblerOptions{}, kTime};
  auto sample = axes_at(kViewStart, 0.1);
  sample.missing_mask = 0b1000;
  sample.head.flags |= SampleFlag::AxisMissing;
  live.take(of(sample));
  EXPECT_EQ(live.axes_known_at(), kViewStart);
}

}  // namespace
}  // namespace abbe::daemon
