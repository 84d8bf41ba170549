#pragma once
/// The clock of the simulated world across processes: host time = speed x CLOCK_MONOTONIC, without
/// an origin to share, so that a daemon given the same speed sees the same time. The devices never
/// read it: they are handed their time (`poll(now)`), and tests hand them whatever they like.
/// Thread-safe (immutable).

#include <chrono>

#include "abbe/protocol/time.hpp"

namespace abbe::sim {

using protocol::HostTime;

class SimClock {
 public:
  /// `speed` > 0: simulated seconds per second of the wall.
  explicit SimClock(double speed) : speed_(speed) {}

  [[nodiscard]] HostTime now() const;
  /// How long simulated `d` takes on the wall.
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
