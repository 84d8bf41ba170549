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

}  // namespace abbe::daemon
