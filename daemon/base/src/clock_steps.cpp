#include "abbe/base/clock_steps.hpp"

#include <fmt/format.h>
#include <time.h>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;

constexpr std::chrono::minutes kLargestStep{5};

nanoseconds read_clock(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return std::chrono::seconds{now.tv_sec} + nanoseconds{now.tv_nsec};
}

/// The two largest units: "200 d 3 h", "5 min 2 s".
std::string duration_text(nanoseconds duration) {
  const auto s = std::chrono::round<std::chrono::seconds>(std::chrono::abs(duration));
  if (s >= 24h) return fmt::format("{} d {} h", s / 24h, (s % 24h) / 1h);
  if (s >= 1h) return fmt::format("{} h {} min", s / 1h, (s % 1h) / 1min);
  if (s >= 1min) return fmt::format("{} min {} s", s / 1min, (s % 1min) / 1s);
  return fmt::format("{} s", s.count());
}

}  // namespace

ClockReading read_clocks() {
  // This clock is read before CLOCK_BOOTTIME, so that the difference, the suspended time, is never
  // negative.
  const nanoseconds running = read_clock(CLOCK_MONOTONIC);
  return {.utc = read_clock(CLOCK_REALTIME),
          .since_boot = read_clock(CLOCK_BOOTTIME),
          .running = running};
}

ClockChange change_between(const ClockReading& start, const ClockReading& now) {
  const nanoseconds by_boot = now.since_boot - start.since_boot;
  return {.step = now.utc - start.utc - by_boot,
          .suspended = by_boot - (now.running - start.running)};
}

std::vector<std::string> in_words(const ClockChange& change, const std::string& since) {
  std::vector<std::string> all;
  if (std::chrono::abs(change.step) >= kLeastClockChange)
    all.push_back(
        fmt::format("the wall clock was set {} by {} since {}: dates before and after "
                    "it do not fit together",
                    change.step > 0s ? "forward" : "backward", duration_text(change.step), since));
  if (change.suspended >= kLeastClockChange)
    all.push_back(
        fmt::format("the computer was suspended for {} since {}: nothing was measured in "
                    "this time",
                    duration_text(change.suspended), since));
  return all;
}

bool ClockSteps::look(const ClockReading& now) {
  stepped_ = stepped_ || std::chrono::abs(change_between(start_, now).step) > kLargestStep;
  return stepped_;
}

}  // namespace abbe::daemon
