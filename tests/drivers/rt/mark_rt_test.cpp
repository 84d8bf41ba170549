#include <gtest/gtest.h>

#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "rt_guards.hpp"

namespace abbe::drivers {
namespace {

CounterScan scan_at_a_mark(std::size_t i) {
  CounterScan s;
  s.axes.head.time = protocol::HostTime{std::chrono::milliseconds{i}};
  s.axes.axis_count = 1;
  s.axes.count[0] = static_cast<std::int64_t>(i);
  s.index_latched_mask = 1;
  return s;
}

TEST(MarkWatcherRt, TakesNoMemory) {
  MarkWatcher watcher;
  tests::expect_no_allocation(10'000, [&](std::size_t i) { watcher.on_scan(scan_at_a_mark(i)); });
}

TEST(MarkWatcherRt, MakesNoSystemCall) {
  MarkWatcher watcher;
  // The first virtual call makes UBSan look at the object through the kernel.
  watcher.on_scan(scan_at_a_mark(0));
  tests::expect_no_system_call([&] {
    for (std::size_t i = 0; i < 1'000; ++i) watcher.on_scan(scan_at_a_mark(i));
  });
}

}  // namespace
}  // namespace abbe::drivers
