#include "abbe/drivers/sampling/mark_watcher.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using protocol::SampleFlag;

/// Axis 0 counts live, axis 1 is latched on its index.
CounterScan scan(std::chrono::nanoseconds time, std::int64_t live, std::int64_t latched) {
  CounterScan s;
  s.axes.head.time = HostTime{time};
  s.axes.axis_count = 2;
  s.axes.count[0] = live;
  s.axes.count[1] = latched;
  s.index_latched_mask = 0b10;
  return s;
}

std::vector<MarkCrossing> crossings_of(MarkWatcher& watcher) {
  std::array<MarkCrossing, 16> room;
  const auto n = watcher.crossings().pop(room);
  return {room.begin(), room.begin() + static_cast<std::ptrdiff_t>(n)};
}

TEST(MarkWatcher, GivesTheCountAtTheMarkBetweenTwoScans) {
  MarkWatcher watcher;
  watcher.on_scan(scan(1ms, 0, 0));
  watcher.on_scan(scan(2ms, 10, 0));
  watcher.on_scan(scan(3ms, 20, 15));
  const auto found = crossings_of(watcher);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].axis, 1);
  EXPECT_EQ(found[0].count, 15);
  EXPECT_EQ(found[0].not_before, HostTime{2ms});
  EXPECT_EQ(found[0].head.time, HostTime{3ms});
}

TEST(MarkWatcher, TheFirstScanReportsNoMark) {
  MarkWatcher watcher;
  watcher.on_scan(scan(1ms, 0, 15));
  watcher.on_scan(scan(2ms, 10, 15));
  EXPECT_TRUE(crossings_of(watcher).empty());
}

TEST(MarkWatcher, TheFirstCrossingAfterARestartIsMarked) {
  MarkWatcher watcher;
  watcher.on_scan(scan(1ms, 0, 15));
  auto anew = scan(2ms, 0, 0);
  anew.axes.head.flags |= SampleFlag::Restarted;
  watcher.on_scan(anew);
  watcher.on_scan(scan(3ms, 0, 7));
  watcher.on_scan(scan(4ms, 0, 9));
  const auto found = crossings_of(watcher);
  ASSERT_EQ(found.size(), 2u) << "counts that began anew are no mark";
  EXPECT_TRUE(has(found[0].head.flags, SampleFlag::Restarted));
  EXPECT_FALSE(has(found[1].head.flags, SampleFlag::Restarted));
}

}  // namespace
}  // namespace abbe::drivers
