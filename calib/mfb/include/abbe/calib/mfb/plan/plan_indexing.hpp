#pragma once
/// Positions of the bar that are reached with one clamping on a table with two rotary axes: a
/// swivel axis A' or B', which carries a rotary axis C'. The pose of every position is estimated,
/// so errors of the rotary axes have no effect on the result; only their repeatability within a
/// pass counts.
///     R_bar = R_swivel(s) R_z(c) R_clamped,   p - centre = R_swivel(s) R_z(c) p_clamped
/// Units: m, rad. Pure.

#include <string>
#include <vector>

#include "abbe/calib/mfb/plan/plan_positions.hpp"

namespace abbe::calib::mfb {

struct RotaryTable {
  Vector3 centre_m = Vector3::Zero();  ///< place of the tip at which the axes cross
  Axis swivel = Axis::X;               ///< direction of the swivel axis: X for A', Y for B'
  double min_swivel_rad = -1.6, max_swivel_rad = 1.6;
};

struct IndexedPosition {
  std::size_t clamping = 0;
  double swivel_rad = 0.0, turn_rad = 0.0;  ///< right-handed rotations of the bar about the axes
};

/// Assigns a clamping and angles to each position, with few clampings: repeatedly selects the
/// clamping from which most of the remaining positions are reached. The range of the swivel axis
/// must contain 0.
[[nodiscard]] std::vector<IndexedPosition> indexed_positions(const std::vector<PlannedPosition>&,
                                                             const Bar&, const RotaryTable&);
[[nodiscard]] std::size_t clampings_of(const std::vector<IndexedPosition>&);

}  // namespace abbe::calib::mfb
