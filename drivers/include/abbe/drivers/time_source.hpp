#pragma once
/// The clock of the drivers: a driver never reads a system clock directly. Host time is speed x
/// CLOCK_MONOTONIC. Processes with the same `speed` therefore have the same host time without
/// exchanging an origin. All functions are thread-safe.

#include <chrono>

#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class TimeSource {
 public:
  TimeSource() = default;
  TimeSource(const TimeSource&) = delete;
  TimeSource& operator=(const TimeSource&) = delete;
  virtual ~TimeSource() = default;

  [[nodiscard]] virtual protocol::HostTime now() const noexcept = 0;
  /// The time to pass to the operating system (poll, nanosleep) in order to wait for `host`.
  [[nodiscard]] virtual std::chrono::nanoseconds wall(
      std::chrono::nanoseconds host) const noexcept = 0;
  /// Host duration that passes in `wall` of the operating system's time.
  [[nodiscard]] virtual std::chrono::nanoseconds host(
      std::chrono::nanoseconds wall) const noexcept = 0;
};

/// Host time = speed x CLOCK_MONOTONIC. With real devices the speed is 1.
class MonotonicTime final : public TimeSource {
 public:
  explicit MonotonicTime(double speed = 1.0) noexcept : speed_(speed) {}
  [[nodiscard]] protocol::HostTime now() const noexcept override;
  [[nodiscard]] std::chrono::nanoseconds wall(
      std::chrono::nanoseconds host) const noexcept override;
  [[nodiscard]] std::chrono::nanoseconds host(
      std::chrono::nanoseconds wall) const noexcept override;
  [[nodiscard]] double speed() const noexcept { return speed_; }

 private:
  double speed_;
};

}  // namespace abbe::drivers
