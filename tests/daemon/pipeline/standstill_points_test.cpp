#include <gtest/gtest.h>

#include "abbe/pipeline/standstill_points.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::SampleFlag;
using protocol::Snapshot;

/// A machine that stands at X = 0, 0.1, 0.2 ... m for `stand`, and drives for 2 s in between; the
/// tracker sees the reflector 1 m further in x, 10 um to and fro.
Snapshot at(std::chrono::nanoseconds t, std::chrono::nanoseconds stand) {
  Snapshot s;
  const auto place = t / (stand + 2s);
  const std::chrono::duration<double> driving = std::max(0ns, t % (stand + 2s) - stand);
  const double x = 0.1 * static_cast<double>(place) + 0.05 * driving.count();
  s.head.time = protocol::HostTime{t};
  s.axis_count = 3;
  s.position[0] = x;
  s.has_tracker_point = true;
  s.tracker_point.p_tracker_m = {1.0 + x + ((t / 1ms) % 2 == 0 ? 10e-6 : -10e-6), 0.5, 0.25};
  return s;
}

StandstillPoints seen(std::chrono::nanoseconds period, std::chrono::nanoseconds stand,
                      std::chrono::nanoseconds until) {
  StandstillPoints points;
  for (auto t = 0ns; t < until; t += period) points.take(at(t, stand));
  return points;
}

TEST(StandstillPoints, AreMeansOfEveryStandstill) {
  auto points = seen(3ms, 3s, 15s);
  ASSERT_EQ(points.points().size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& p = points.points()[i];
    EXPECT_NEAR(p.mean.reading_m.x(), 0.1 * static_cast<double>(i), 1e-12);
    EXPECT_NEAR(p.mean.measured_m.x(), 1.0 + 0.1 * static_cast<double>(i), 0.1e-6);
    EXPECT_NEAR(p.scatter_m, 10e-6, 0.1e-6);
    EXPECT_NEAR(static_cast<double>(p.tracker_points), 2000.0 / 3.0, 2.0);  // 3 s less both ends
  }
}

TEST(StandstillPoints, TakeTheMeansOfAStationaryTracker) {
  auto points = seen(501ms, 3s, 15s);
  ASSERT_EQ(points.points().size(), 3u);
  for (const auto& p : points.points()) EXPECT_GE(p.tracker_points, 2u);
}

TEST(StandstillPoints, AreNotReportedForAShortPause) {
  EXPECT_TRUE(seen(3ms, 900ms, 15s).points().empty());
}

TEST(StandstillPoints, EndWithTheStream) {
  auto points = seen(3ms, 3s, 2s);
  EXPECT_TRUE(points.points().empty());
  EXPECT_GT(points.standing(), 0u);
  points.finish();
  ASSERT_EQ(points.points().size(), 1u);
  EXPECT_EQ(points.standing(), 0u);
}

TEST(StandstillPoints, LeaveOutPointsTheTrackerMarksInvalid) {
  StandstillPoints points;
  for (auto t = 0ns; t < 3s; t += 3ms) {
    auto s = at(t, 3s);
    if ((t / 3ms) % 2 == 0) {
      s.tracker_point.p_tracker_m[2] = 7.0;
      s.tracker_point.head.flags |= SampleFlag::PointInvalid;
    }
    points.take(s);
  }
  points.finish();
  ASSERT_EQ(points.points().size(), 1u);
  EXPECT_NEAR(points.points()[0].mean.measured_m.z(), 0.25, 1e-12);
}

TEST(StandstillPoints, EndWhereAxesAreMissing) {
  StandstillPoints points;
  for (auto t = 0ns; t < 3s; t += 3ms) {
    auto s = at(t, 3s);
    if (t == 1500ms) s.missing_mask = 1;
    points.take(s);
  }
  points.finish();
  EXPECT_EQ(points.points().size(), 2u);
}

}  // namespace
}  // namespace abbe::daemon
