#pragma once
/// Describes how V of a model of tables depends on the direction of travel (backlash). With s = 1
/// while an axis travels forward and -1 backward, the value of each of its tables at position q is
///     U(q) + s D(q) / 2
/// U: the tables of the model, which are the mean of both directions; D: forward minus backward,
/// one value per table (TravelDependence::Backlash) or one per node (Tables).

#include <Eigen/Core>

#include "abbe/calib/geometry/table_basis.hpp"

namespace abbe::calib {

struct TravelDifferences {
  TravelDependence kind = TravelDependence::Backlash;  ///< Backlash or Tables
  Eigen::VectorXd D;                                   ///< m or rad, in the order of the tables
  Eigen::MatrixXd covariance;                          ///< covariance of D
  Eigen::MatrixXd cov_U_D;  ///< covariance of the n parameters of the model with the m entries of
                            ///< D, n x m
};

/// Changes of the n model parameters for forward travel of one axis: D / 2 in the tables of this
/// axis, else 0. One column for each axis. `basis` must have the dependence on travel to which D
/// belongs.
[[nodiscard]] Eigen::MatrixXd half_differences(const TableBasis& basis, const Eigen::VectorXd& D);

}  // namespace abbe::calib
