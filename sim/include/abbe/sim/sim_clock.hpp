#pragma once
/// The simulated clock, common to several processes: host time = speed x CLOCK_MONOTONIC. There is
/// no origin to exchange: a daemon with the same speed has the same time. The devices never read
/// it: the caller passes the time to poll(now), a test passes any time. Thread-safe (immutable).

#include <chrono>

#include "abbe/protocol/time.hpp"

namespace abbe::sim {

using protocol::HostTime;

class SimClock {
 public:
  /// `speed` > 0: simulated seconds per wall-clock second.
  explicit SimClock(double speed) : speed_(speed) {}

  [[nodiscard]] HostTime now() const;
  /// The wall-clock duration of the simulated duration `d`.
  [[nodiscard]] std::chrono::nanoseconds wall(std::chrono::nanoseconds d) const;
  [[nodiscard]] double speed() const { return speed_; }

 private:
  double speed_;
};

[[nodiscard]] constexpr std::chrono::nanoseconds seconds_to_ns(double s) {
  return std::chrono::nanoseconds{static_cast<std::int64_t>(s * 1e9 + (s < 0.0 ? -0.5 : 0.5))};
}
[[nodiscard]] constexpr double ns_to_seconds(std::chrono::nanoseconds d) {
  return static_cast<double>(d.count()) * 1e-9;
}

}  // namespace abbe::sim
