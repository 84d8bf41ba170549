#pragma once
/// The source of all dates: dates of models, activations, drift and measurements. A date is read
/// when it is needed. It is never computed from the clock at the start of the process, because the
/// wall clock may be set in between. Copies have the same start. Thread-safe.

#include <chrono>
#include <functional>
#include <utility>

#include "abbe/base/clock_steps.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// The present time, for code that has no WallClock.
[[nodiscard]] inline protocol::UtcTime utc_now() {
  return protocol::UtcTime{std::chrono::system_clock::now().time_since_epoch()};
}

class WallClock {
 public:
  /// This function may be called from any thread.
  using Read = std::function<ClockReading()>;
  explicit WallClock(Read read) : read_(std::move(read)), start_(read_()) {}
  WallClock() : WallClock(read_clocks) {}

  [[nodiscard]] ClockReading read() const { return read_(); }
  [[nodiscard]] protocol::UtcTime now() const { return protocol::UtcTime{read_().utc}; }
  /// The offset that converts host times of samples to UTC dates, from the wall clock as it is now;
  /// `host_now`: the present host time. Recordings and messages contain the offset at the start.
  /// The two differ if the clock was set or the computer was suspended.
  [[nodiscard]] protocol::UtcOffset offset(protocol::HostTime host_now) const {
    return {now().time_since_epoch() - host_now.time_since_epoch()};
  }
  [[nodiscard]] ClockChange since_start() const { return change_between(start_, read_()); }

 private:
  Read read_;
  ClockReading start_;
};

}  // namespace abbe::daemon
