#pragma once
/// Finds single values of directly measured error motions that do not fit the other values: a row
/// that holds 0, -9999 or 1e30 for a value that was not measured, or a wrong digit.
///
/// A pass is one direction of one run. The curvature of a value is its difference from the straight
/// line through its neighbours in the pass (at an end of the pass: through the next two values). An
/// offset or slope of a pass does not change it. With at least three passes, d = curvature minus
/// its median over the passes at this position; else d = curvature. Robust scale: s = 1.4826 median
/// |d| over all values of the error. The limit of |d| is
///     max(20 s, 5 r) + 1e-7   (0.1 um or urad: the resolution of files)
/// r: resolution of the instrument, the smallest difference of two values of the error. With a
/// coarse resolution most d are 0, and so is s.
///
/// A wrong value also changes the curvature of its neighbours. If a pass has a |d| above the limit,
/// the function therefore names the one value, or the two values, without which no |d| of the pass
/// exceeds the limit. With one or two passes it also names a real step of the machine at one
/// position. Passes with fewer than five positions are not tested. Pure; allocates.

#include <cstddef>
#include <vector>

#include "abbe/calib/direct/runs.hpp"

namespace abbe::calib::direct {

struct ReadingOff {
  std::size_t reading = 0;  ///< index in MeasuredError::readings
  double distance = 0.0;    ///< |d| of this value, in m or rad
};

/// Returns the values that do not fit, by ascending index of the reading.
[[nodiscard]] std::vector<ReadingOff> readings_off(const MeasuredError&);

}  // namespace abbe::calib::direct
