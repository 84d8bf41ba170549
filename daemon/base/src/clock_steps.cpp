#include "abbe/base/clock_steps.hpp"

#include <time.h>

namespace abbe::daemon {
namespace {

constexpr std::chrono::minutes kLargestStep{5};

std::chrono::nanoseconds read_clock(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return std::chrono::seconds{now.tv_sec} + std::chrono::nanoseconds{now.tv_nsec};
}

}  // namespace

ClockReading read_clocks() {
  return {.utc = read_clock(CLOCK_REALTIME), .since_boot = read_clock(CLOCK_BOOTTIME)};
}

bool ClockSteps::look(const ClockReading& now) {
  const auto step = now.utc - now.since_boot - start_;
  stepped_ = stepped_ || step > kLargestStep || step < -kLargestStep;
  return stepped_;
}

}  // namespace abbe::daemon
