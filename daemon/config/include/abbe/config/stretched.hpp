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

/// Same as stretched(), but for the silence after which a device is faulty. The operating system
/// may suspend a simulated device for longer than this silence, because the device shares the
/// processors with other programs. At `speed` > 1 the result is therefore at least one second of
/// the operating system's clock.
[[nodiscard]] inline std::chrono::nanoseconds stretched_silence(std::chrono::nanoseconds silence,
                                                                double speed) {
  constexpr std::chrono::nanoseconds kLongestPause = std::chrono::seconds{1};
  return stretched(speed > 1.0 ? std::max(silence, kLongestPause) : silence, speed);
}

}  // namespace abbe::daemon
