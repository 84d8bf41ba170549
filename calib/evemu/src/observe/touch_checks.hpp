#pragma once
/// Checks of touches: a false touch among those of one feature, and touches from below.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/observe/observe.hpp"

namespace abbe::calib::evemu {

/// Checks the touches of one feature. Returns a message to the user, or nullopt if no touch is
/// wrong. A message is returned if one touch lies farther than `least_false_touch_m` from the
/// surface through the other touches, and these lie ten times closer to that surface ("touch 3 of
/// 25 lies 0.7 mm off ..."), or if touches lie farther than `max_off_surface_m` from the surface
/// through all of them.
[[nodiscard]] std::optional<std::string> wrong_touch_on_ball(std::span<const Vector3> points_m,
                                                             const ObserveOptions&);
[[nodiscard]] std::optional<std::string> wrong_touch_on_face(std::span<const Vector3> points_m,
                                                             const ObserveOptions&);

/// True if the balls seem to be touched from below, where the plate is. This shows that an axis is
/// mirrored: the mirror image of a planar array has the same shape, and only the touched side
/// differs.
[[nodiscard]] bool touched_from_below(const TouchedArtefact&);

}  // namespace abbe::calib::evemu
