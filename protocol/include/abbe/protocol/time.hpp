#pragma once
/// The clocks of the project, as types. Subtracting instants of two different clocks does not
/// compile; only a ClockModel converts between them. No clock has a now(): drivers and daemon read
/// the system clocks, and the functions of this module get every time as an argument.

#include <chrono>
#include <cstdint>

namespace abbe::protocol {

/// Host time: CLOCK_MONOTONIC, or speed x CLOCK_MONOTONIC with simulated devices. Never the wall
/// clock.
struct HostClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<HostClock>;
  static constexpr bool is_steady = true;
};
using HostTime = HostClock::time_point;

/// A device's own free-running clock with arbitrary epoch (tracker seconds and microseconds,
/// encoder ticks).
struct DeviceClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<DeviceClock>;
  static constexpr bool is_steady = true;
};
using DeviceTime = DeviceClock::time_point;

/// Wall-clock time. Used only in UtcOffset, for display and file dates.
using UtcTime = std::chrono::sys_time<std::chrono::nanoseconds>;

/// UTC = host + offset. Determined once at start, recorded and published. Samples contain host time
/// only.
struct UtcOffset {
  std::chrono::nanoseconds value{};
  [[nodiscard]] constexpr UtcTime to_utc(HostTime t) const noexcept {
    return UtcTime{t.time_since_epoch() + value};
  }
  [[nodiscard]] constexpr HostTime to_host(UtcTime t) const noexcept {
    return HostTime{t.time_since_epoch() - value};
  }
};

}  // namespace abbe::protocol
