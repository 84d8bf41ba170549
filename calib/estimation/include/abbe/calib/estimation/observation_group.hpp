#pragma once
/// Result of the stage `observe` of a method: observations with common noise and common nuisances,
///     y = A U + L c + noise,   c ~ N(0, diag u^2),   noise ~ N(0, C)
/// U: unknowns that other groups share (parameters of the model, scale of an instrument, artefact),
/// c: nuisances of this group alone (pose, offset, clock).

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

namespace abbe::calib::estimation {

/// A nuisance without a prior.
inline constexpr double kNoPrior = std::numeric_limits<double>::infinity();

struct ObservationGroup {
  std::vector<std::size_t> unknowns;  ///< index in U of each column of A
  Eigen::MatrixXd A;                  ///< rows x unknowns.size()
  Eigen::MatrixXd L{};                ///< rows x nuisances; without columns: no nuisances
  std::vector<double> u_nuisance{};   ///< standard deviation of the prior, or kNoPrior
  Eigen::VectorXd y;
  /// covariance of y: rows x rows, or one column with the variances of independent rows
  Eigen::MatrixXd covariance;
};

}  // namespace abbe::calib::estimation
