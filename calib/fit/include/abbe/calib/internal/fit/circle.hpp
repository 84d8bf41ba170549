#pragma once
/// Least-squares circle in a plane: minimises sum (|p_i - c| - r)^2 by Gauss-Newton from the
/// algebraic fit. The covariance assumes equal, independent noise of the points along the normal,
/// with a standard deviation computed from the residuals.

#include <optional>
#include <span>

#include "abbe/calib/fit/residuals.hpp"

namespace abbe::calib::fit {

/// Lengths in the unit of the points.
struct Circle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0.0;
  Matrix3 covariance = Matrix3::Zero();  ///< covariance of centre x y and radius; zero for 3 points
  ResidualStatistics residuals;
  /// condition number of the Jacobian with lengths in units of the size of the points; large if
  /// the points cover only a flat arc
  double condition = 0.0;
  int iterations = 0;
};

/// Fits a circle. NotFinite; TooFewObservations below 3 different points; DegenerateGeometry if
/// they lie on a line; NotConverged if the iteration does not converge to a circle. `known_sigma`:
/// standard deviation of a point along the normal, used for the covariance instead of that of the
/// residuals.
[[nodiscard]] Result<Circle> fit_circle(std::span<const Eigen::Vector2d> points,
                                        std::optional<double> known_sigma = {});

}  // namespace abbe::calib::fit
