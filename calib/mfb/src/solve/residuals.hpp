#pragma once
/// Computes residuals, poses and drift of a simultaneous adjustment.

#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"

namespace abbe::calib::mfb {

/// Derivative of nuisance k by errors of the shared unknowns and of the position: row k of
/// R^-1 [1, -G]. `own`: its part for the rows of the position.
struct NuisanceRow {
  Eigen::VectorXd own;     ///< row k of R^-1
  Eigen::VectorXd shared;  ///< row k of R^-1 G
};
[[nodiscard]] NuisanceRow nuisance_row(const PositionSystem&, Eigen::Index k);
/// Standard uncertainty of nuisance k after the adjustment.
[[nodiscard]] double nuisance_uncertainty(const PositionSystem&, const SharedEstimate&,
                                          Eigen::Index k);
/// Covariance of the shared unknowns with nuisance k.
[[nodiscard]] Eigen::VectorXd covariance_with_nuisance(const PositionSystem&, const SharedEstimate&,
                                                       Eigen::Index k);

void set_residuals(Solution&, const Observations&, const WholeSystem&, const SharedEstimate&);
/// Sets the degrees of freedom of each pass: its number of rows minus their diagonal elements of
/// the hat matrix. Row i of the whitened [A L] has the element |row i of L R^-1|^2 + |row i of (A -
/// L R^-1 G) X|^2, X X^T: covariance of the shared unknowns.
void set_degrees_of_freedom(Solution&, const WholeSystem&, const SharedEstimate&);

}  // namespace abbe::calib::mfb
