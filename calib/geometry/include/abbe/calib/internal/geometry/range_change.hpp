#pragma once
/// A constant by which all ranges of a run are too long or too short: the radius of the reflector
/// counted twice or not at all, a wrong home position.

#include <functional>
#include <optional>
#include <span>
#include <string>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// The point measured in the direction of `p_tracker_m` with a range that is longer by `longer_m`.
[[nodiscard]] Vector3 with_longer_range(const Vector3& p_tracker_m, double longer_m);

/// The change of all ranges with the least rms, at most 60 mm. `rms_m(change)`: rms distance to the
/// path with ranges changed by this; nullopt if the points cannot be aligned then. Its square is a
/// parabola of the change, except for the assignment to the path. Errors of the machine that act as
/// a scale error e at the range r shift it by e r: 100 um/m at 2 m by 0.2 mm. nullopt: not found.
[[nodiscard]] std::optional<double> best_range_change_m(
    const std::function<std::optional<double>(double change_m)>& rms_m);

/// "ranges shorter by 19.05 mm (radius of the reflector, or home position of the tracker)".
[[nodiscard]] std::string range_change_text(double change_m);

/// Radii of usual reflectors: 1.5, 7/8 and 1/2 inch.
[[nodiscard]] std::span<const double> reflector_radii_m();

}  // namespace abbe::calib
