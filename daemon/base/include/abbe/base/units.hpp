#pragma once

#include <chrono>

namespace abbe::daemon {

// Files, reports and messages use mm, um and urad; the program computes in m and rad.
inline constexpr double kMmPerM = 1e3;
inline constexpr double kUmPerM = 1e6;
inline constexpr double kUradPerRad = 1e6;

inline constexpr double kZeroCelsius_K = 273.15;

[[nodiscard]] inline double in_seconds(std::chrono::nanoseconds t) noexcept {
  return std::chrono::duration<double>(t).count();
}

}  // namespace abbe::daemon
