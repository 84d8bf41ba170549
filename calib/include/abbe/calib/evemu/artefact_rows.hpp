#pragma once
/// What errors of the array itself do to the errors seen at its balls. They are the same at every
/// position, in the array's own frame: delta_i of a centre, a small turn d of the uniform frame
/// from the directions of the blocks, a relative length k. At position p they are taken for
///     R_p [ (delta_i - delta_1) - d x (a_i - a_1) + k (a_i - a_1) ]
/// of ball i ([Li OMM] eq. (12): ideal - actual), R_p: rotation of T_self_uni, a: places in the uniform
/// frame. d: z turns with block 1 (u1 about x and y); about z with both,
///     u^2 = (u2^2 + (n1 . n2)^2 u1^2) / |n2 x n1|^2,    correlated with that about y where n1 . n2 != 0.

#include <Eigen/Core>

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

/// A, 3 rows.size() x n: errors seen at the balls are A zeta, zeta ~ N(0, 1), each column one
/// standard uncertainty. Columns: x, y, z of every ball; direction of block 1 along x and y, of
/// block 2 along x; length
/// - without those that are known exactly. No columns for errors that were given without an array.
[[nodiscard]] Eigen::MatrixXd artefact_rows(const Observations&);

}  // namespace abbe::calib::evemu
