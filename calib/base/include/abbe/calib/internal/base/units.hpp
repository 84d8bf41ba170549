#pragma once

namespace abbe::calib {

// calib computes in metres; messages and the named coefficients of the equivalent model are in
// millimetres and micrometres.
inline constexpr double kMmPerM = 1e3;
inline constexpr double kUmPerM = 1e6;

}  // namespace abbe::calib
