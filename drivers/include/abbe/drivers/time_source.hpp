#pragma once
/// The clock of the drivers: a driver never reads a system clock directly. Host time is speed x
/// CLOCK_MONOTONIC. Processes with the same `speed` therefore have the same host time without
/// exchanging an origin. All functions are thread-safe.

#include <atomic>
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

/// Host time that advances only by advance(), independently of the operating system's time: so
/// host() is zero, and wall() is `poll_wait`. `poll_wait` is zero unless the peer runs in another
/// thread and needs processor time.
class SteppedTime final : public TimeSource {
 public:
  explicit SteppedTime(protocol::HostTime start = protocol::HostTime{std::chrono::hours{1}},
                       std::chrono::nanoseconds poll_wait = {}) noexcept
      : now_ns_(start.time_since_epoch().count()), poll_wait_(poll_wait) {}

  [[nodiscard]] protocol::HostTime now() const noexcept override {
    return protocol::HostTime{std::chrono::nanoseconds{now_ns_.load(std::memory_order_acquire)}};
  }
  [[nodiscard]] std::chrono::nanoseconds wall(std::chrono::nanoseconds) const noexcept override {
    return poll_wait_;
  }
  [[nodiscard]] std::chrono::nanoseconds host(std::chrono::nanoseconds) const noexcept override {
    return {};
  }

  void advance(std::chrono::nanoseconds by) noexcept {
    // acq_rel: pairs with the acquire in now()
    now_ns_.fetch_add(by.count(), std::memory_order_acq_rel);
  }

 private:
  std::atomic<std::int64_t> now_ns_;
  std::chrono::nanoseconds poll_wait_;
};

}  // namespace abbe::drivers
