#pragma once
/// Time-outs with simulated devices. Pure.

#include <algorithm>
#include <chrono>

namespace abbe::daemon {

/// A time-out in host time: with simulated devices at `speed` > 1 the peer's answer still takes the
/// operating system's time.
[[nodiscard]] inline std::chrono::nanoseconds stretched(std::chrono::nanoseconds time_out,
                                                        double speed) {
  const std::chrono::duration<double, std::nano> longer = time_out * std::max(speed, 1.0);
  return std::chrono::duration_cast<std::chrono::nanoseconds>(longer);
}

}  // namespace abbe::daemon
