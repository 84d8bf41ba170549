#pragma once
/// What is wrong with touches as a whole: one of them, the side they were on.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

/// A touch that lies farther than `least_false_touch_m` from the surface through the others, which
/// lie ten times better: "touch 3 of 25 lies 0.7 mm off ..."; or touches that lie farther than
/// `max_off_surface_m` from one surface.
[[nodiscard]] std::optional<std::string> wrong_touch_on_ball(std::span<const Vector3> points_m,
                                                             const ObserveOptions&);
[[nodiscard]] std::optional<std::string> wrong_touch_on_face(std::span<const Vector3> points_m,
                                                             const ObserveOptions&);

/// Balls of a planar array have the same shape in a mirror: only the side on which they are touched
/// differs. True: they were touched from below, where the plate is.
[[nodiscard]] bool touched_from_below(const SeenArtefact&);

}  // namespace abbe::calib::evemu
