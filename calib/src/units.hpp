#pragma once

namespace abbe::calib {

// Messages and the named coefficients are in millimetres and micrometres.
inline constexpr double kMmPerM = 1e3;
inline constexpr double kUmPerM = 1e6;

}  // namespace abbe::calib
