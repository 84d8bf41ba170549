#pragma once
/// Time-outs with simulated devices. Pure.

#include <algorithm>
#include <chrono>

namespace abbe::daemon {

/// A time-out in host time. With simulated devices and `speed` > 1 host time runs `speed` times
/// faster than the clock of the operating system, but the peer does not answer faster. The time-out
/// is therefore multiplied by `speed`.
[[nodiscard]] inline std::chrono::nanoseconds stretched(std::chrono::nanoseconds time_out,
                                                        double speed) {
  const std::chrono::duration<double, std::nano> longer = time_out * std::max(speed, 1.0);
  return std::chrono::duration_cast<std::chrono::nanoseconds>(longer);
}

/// stretched(), for the silence after which a device has a fault. The operating system stops a
/// simulated device, which shares the processors with other programs, for longer than many a
/// device may be silent: at `speed` > 1 the silence lasts at least a second of its clock.
[[nodiscard]] inline std::chrono::nanoseconds stretched_silence(std::chrono::nanoseconds silence,
                                                                double speed) {
  constexpr std::chrono::nanoseconds kLongestPause = std::chrono::seconds{1};
  return stretched(speed > 1.0 ? std::max(silence, kLongestPause) : silence, speed);
}

}  // namespace abbe::daemon
