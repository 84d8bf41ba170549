#pragma once
/// Effect of errors of the array itself on the errors observed at its balls. In the array's own
/// frame the errors of the array are the same at every position: delta_i of the centre of ball i, a
/// small rotation d of the uniform frame (from errors of the block directions), a relative length
/// error k. At position p they change the observed error of ball i ([Li OMM] eq. (12): ideal -
/// actual) by
///     R_p [ (delta_i - delta_1) - d x (a_i - a_1) + k (a_i - a_1) ]
/// R_p: rotation from the uniform frame (artefact.hpp) to machine coordinates; a: ball centres in
/// the uniform frame. n1, n2: normals of the blocks; u1, u2: standard uncertainties of their
/// directions. The uncertainty of d about x and y is u1. About z both blocks contribute:
///     u^2 = (u2^2 + (n1 . n2)^2 u1^2) / |n2 x n1|^2
/// Where n1 . n2 != 0, the rotations about z and y are correlated.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "abbe/calib/evemu/observe/observe.hpp"

namespace abbe::calib::evemu {

/// Matrix A, 3 rows.size() x n: errors of the array change the errors observed at the balls by
/// A zeta, zeta ~ N(0, 1). Each column is the effect of one error that is as large as its standard
/// uncertainty. Order of the columns: x, y, z of every ball; direction of block 1 along x and y;
/// direction of block 2 along x; length. A quantity with zero uncertainty has no column. No columns
/// if the errors were given without an array (observe_errors()).
[[nodiscard]] Eigen::MatrixXd artefact_rows(const Observations&);

/// The error of the array to which a column of artefact_rows() belongs.
struct ArtefactError {
  std::string name;  ///< such as "y of ball 3", "direction of block 1 along x", "length"
  double u = 0.0;    ///< standard uncertainty in m, rad or relative
};
/// The errors of all columns, in the order of the columns.
[[nodiscard]] std::vector<ArtefactError> artefact_errors(const Observations&);

}  // namespace abbe::calib::evemu
