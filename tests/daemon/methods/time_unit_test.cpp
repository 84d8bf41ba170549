/// Times that are not in seconds, of runs on the fly and with long stops.
#include "abbe/methods/otf/time_unit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace abbe::daemon {
namespace {

using ::testing::HasSubstr;

constexpr double kLeg_m = 0.05, kMove_s = 0.15;  // 20000 mm/min
constexpr std::size_t kLegs = 250;

PathFile path() {
  PathFile file;
  file.source.name = "path.csv";
  for (std::size_t i = 0; i <= kLegs; ++i) {
    file.vertices_m.push_back({i % 2 == 0 ? 0.0 : kLeg_m, 0.0, 0.0});
    file.feed_m_per_s.push_back(kLeg_m / kMove_s);
  }
  return file;
}

/// One row every `period_s`; `unit`: time of the file per second.
TrackerFile tracker(double dwell_s, double period_s, double unit) {
  TrackerFile file;
  const double leg_s = dwell_s + kMove_s;
  for (double t_s = 0.0; t_s < static_cast<double>(kLegs) * leg_s; t_s += period_s) {
    const auto leg = static_cast<std::size_t>(t_s / leg_s);
    const double moved =
        std::max(0.0, t_s - static_cast<double>(leg) * leg_s - dwell_s) / kMove_s * kLeg_m;
    file.points.push_back({t_s * unit, {leg % 2 == 0 ? moved : kLeg_m - moved, 2.0, 0.0}});
  }
  file.times = {0.0, 2, 1 + file.points.size()};
  return file;
}

TEST(TimeUnit, LongStopsAreNoOtherUnit) {
  for (const double dwell_s : {0.1, 6.0, 20.0}) {
    EXPECT_TRUE(check_time_unit("tracker.csv", tracker(dwell_s, 0.02, 1.0), path())) << dwell_s;
    const auto wrong = check_time_unit("tracker.csv", tracker(dwell_s, 0.02, 1e3), path());
    ASSERT_FALSE(wrong) << dwell_s;
    EXPECT_THAT(wrong.error().text, HasSubstr("they fit as milliseconds"));
  }
}

/// It is not known how much of the time between two rows is a stop.
TEST(TimeUnit, OneRowForEachStopIsOnlyCheckedForTimesThatAreTooShort) {
  const double dwell_s = 60.0, period_s = dwell_s + kMove_s;
  EXPECT_TRUE(check_time_unit("tracker.csv", tracker(dwell_s, period_s, 1.0), path()));
  const auto wrong = check_time_unit("tracker.csv", tracker(0.0, kMove_s, 1.0 / 3600.0), path());
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().text, HasSubstr("they fit as"));
}

}  // namespace
}  // namespace abbe::daemon
