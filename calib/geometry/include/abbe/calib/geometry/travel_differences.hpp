#pragma once
/// How V of a model of tables depends on the direction of travel (backlash). With s = 1 while an
/// axis travels forward and -1 backward, the value of each of its tables at position q is
///     U(q) + s D(q) / 2
/// U: the tables of the model, which are the mean of both directions; D: forward minus backward,
/// one value per table (TravelDependence::Backlash) or one per node (Tables).

#include <Eigen/Core>

#include "abbe/calib/geometry/table_basis.hpp"

namespace abbe::calib {

struct TravelDifferences {
  TravelDependence kind = TravelDependence::Backlash;  ///< not None
  Eigen::VectorXd D;                                   ///< m or rad, in the order of the tables
  Eigen::MatrixXd covariance;                          ///< of D
  Eigen::MatrixXd cov_U_D;  ///< covariance of the parameters of the model with D, n x m
};

/// s D / 2 of the tables of each axis travelling forward, in a column for each axis: effect on the
/// n parameters of the model. `basis`: with the dependence on travel to which D belongs.
[[nodiscard]] Eigen::MatrixXd half_differences(const TableBasis& basis, const Eigen::VectorXd& D);

}  // namespace abbe::calib
