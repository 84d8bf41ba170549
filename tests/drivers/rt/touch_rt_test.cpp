#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "../simulated_scans.hpp"
#include "abbe/drivers/sampling/touch_detector.hpp"
#include "rt_guards.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;

TouchOptions quick() {
  TouchOptions o;
  o.approach.speed_window = 1ms;
  o.switching = {.confirm = 1ms, .chatter = 200us, .rearm_quiet = 1ms, .rearm_retract_m = 1e-6};
  o.window_before = 1ms;
  o.window_after = 500us;
  return o;
}

std::vector<CounterScan> scans(std::size_t count) {
  tests::SimulatedScans source{tests::SimulatedProbe{.chatter_s = {40e-6}}, 1};
  std::vector<CounterScan> out(count);
  for (CounterScan& scan : out) scan = source.next();
  return out;
}

TEST(TouchDetectorRt, TakesNoMemory) {
  const auto source = scans(10'000);
  TouchDetector detector{quick()};
  tests::expect_no_allocation(source.size(), [&](std::size_t i) { detector.on_scan(source[i]); });
  EXPECT_GE(detector.counters().touches.value(), 40u);
}

TEST(TouchDetectorRt, MakesNoSystemCall) {
  const auto source = scans(1'000);
  TouchDetector detector{quick()};
  // The first virtual call makes UBSan look at the object through the kernel.
  detector.on_scan(source.front());
  tests::expect_no_system_call([&] {
    for (const CounterScan& scan : source) detector.on_scan(scan);
  });
}

}  // namespace
}  // namespace abbe::drivers
