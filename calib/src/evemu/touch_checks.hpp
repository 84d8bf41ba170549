#pragma once
/// What is wrong with touches as a whole: their unit, one of them, their handedness, positions that are the
/// same.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

/// "1000 times as large as ...", if the ratio is that of two units of length.
[[nodiscard]] std::optional<std::string> wrong_unit(double fitted_radius_m, double expected_radius_m);

/// A touch that lies farther than `most_off_m` from the surface through the others, which lie ten times
/// better: "touch 3 of 25 lies 0.7 mm off ...".
[[nodiscard]] std::optional<std::string> wrong_touch_on_ball(std::span<const Vector3> points_m,
                                                             double most_off_m);
[[nodiscard]] std::optional<std::string> wrong_touch_on_face(std::span<const Vector3> points_m,
                                                             double most_off_m);

/// Balls of a planar array have the same shape in a mirror: only the side on which they are touched tells.
/// True: they were touched from below, where the plate is.
[[nodiscard]] bool touched_from_below(const SeenArtefact&);

/// BadInput: two positions in which the array stands alike.
[[nodiscard]] Result<void> check_turns(std::span<const SeenArtefact>, double least_turn_rad);

}  // namespace abbe::calib::evemu
