#pragma once
/// A constant by which all ranges of a tracker run are too long or too short: the radius of the
/// reflector was counted twice or not at all, or the home position is wrong.

#include <functional>
#include <optional>
#include <span>
#include <string>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// The point measured in the direction of `p_tracker_m` with a range that is longer by `longer_m`.
[[nodiscard]] Vector3 with_longer_range(const Vector3& p_tracker_m, double longer_m);

/// Finds the change of all ranges with the smallest rms distance to the path, at most 60 mm.
/// `rms_m(change)` returns this rms distance after all ranges were changed by `change`, or nullopt
/// if the points cannot be aligned. The search assumes that its square is a parabola of the change;
/// this holds except for changes of the assignment of points to the path. Machine errors that act
/// as a scale error e at the range r shift the result by e r: 100 um/m at 2 m by 0.2 mm. Returns
/// nullopt if no minimum is found.
[[nodiscard]] std::optional<double> best_range_change_m(
    const std::function<std::optional<double>(double change_m)>& rms_m);

/// Text such as "ranges shorter by 19.05 mm (radius of the reflector, or home position of the
/// tracker)".
[[nodiscard]] std::string range_change_text(double change_m);

/// Radii of usual reflectors: 1.5, 7/8 and 1/2 inch.
[[nodiscard]] std::span<const double> reflector_radii_m();

}  // namespace abbe::calib
