#pragma once
/// Elimination of nuisances from rows of a linear problem.

#include <Eigen/Core>

namespace abbe::calib::estimation {

struct Eliminated {
  Eigen::MatrixXd rows;   ///< rows of `kept` that do not depend on the eliminated unknowns
  Eigen::Index rank = 0;  ///< number of rows that determined the eliminated unknowns
};
/// Transforms the rows [L | kept] to rows that do not contain the unknowns of L. The transformation
/// is orthogonal, so that the result contains all that the rows state about the other unknowns. L
/// may have any rank.
[[nodiscard]] Eliminated eliminate(Eigen::MatrixXd L, const Eigen::MatrixXd& kept);

}  // namespace abbe::calib::estimation
