#pragma once

namespace abbe::calib {

// calib computes in metres. Messages, and the coefficients of the equivalent model that have names,
// are in millimetres and micrometres.
inline constexpr double kMmPerM = 1e3;
inline constexpr double kUmPerM = 1e6;

}  // namespace abbe::calib
