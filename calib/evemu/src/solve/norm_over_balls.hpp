#pragma once
/// Compares models of a ball array by their V at the balls.

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/geometry/scaled_design.hpp"
#include "abbe/calib/internal/geometry/rigid_free_norm.hpp"

namespace abbe::calib::evemu {

/// Norm for comparing models of a ball array with each other and with their uncertainty. It is the
/// root mean square of V over the readings of all balls at all positions, without rigid motion, for
/// a V given by coefficients of the design.
[[nodiscard]] RigidFreeNorm norm_over_balls(const Observations&, const ScaledDesign&);

}  // namespace abbe::calib::evemu
