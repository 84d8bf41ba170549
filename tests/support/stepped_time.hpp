#pragma once
/// The clock of a driver under test.

#include <atomic>
#include <chrono>
#include <cstdint>

#include "abbe/drivers/time_source.hpp"

namespace abbe::tests {

/// Host time that advances only by advance(), independently of the operating system's time: so
/// host() is zero, and wall() is `poll_wait`. `poll_wait` is zero unless the peer runs in another
/// thread and needs processor time.
class SteppedTime final : public drivers::TimeSource {
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

}  // namespace abbe::tests
