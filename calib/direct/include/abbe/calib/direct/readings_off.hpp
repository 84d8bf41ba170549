#pragma once
/// Single values of directly measured error motions that do not fit the other values: a row that
/// holds 0, -9999 or 1e30 for a value that was not measured, or a wrong digit.
///
/// A pass is one direction of one run. The curvature of a value is its difference from the straight
/// line through its neighbours in the pass (at an end: through the next two), which no offset or
/// slope of a pass changes. With at least three passes, d = curvature minus its median over the
/// passes at this position; else d = curvature. Robust scale: s = 1.4826 median |d| over all values
/// of the error. A value is off if
///     |d| > max(20 s, 5 r) + 1e-7   (0.1 um or urad: the resolution of files)
/// with the resolution r of the instrument, the smallest difference of two values of the error:
/// where it is coarse, most d are 0 and so is s,
/// and if without it (or without it and one other) no value of its pass is: its neighbours, whose
/// curvature it changes, are not named. With one or two passes a real step of the machine at one
/// position is named, too. Not tested: passes with fewer than five positions. Pure; allocates.

#include <cstddef>
#include <vector>

#include "abbe/calib/direct/runs.hpp"

namespace abbe::calib::direct {

struct ReadingOff {
  std::size_t reading = 0;  ///< index in MeasuredError::readings
  double distance = 0.0;    ///< |d|
};

/// Ascending by reading.
[[nodiscard]] std::vector<ReadingOff> readings_off(const MeasuredError&);

}  // namespace abbe::calib::direct
