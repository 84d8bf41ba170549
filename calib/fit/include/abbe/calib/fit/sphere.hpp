#pragma once
/// Least-squares sphere: minimises sum (|p_i - c| - r)^2 by Gauss-Newton from the algebraic fit.
/// The covariance assumes equal, independent noise of the points along the normal, with a standard
/// deviation computed from the residuals.

#include <optional>
#include <span>

#include "abbe/calib/fit/residuals.hpp"

namespace abbe::calib::fit {

/// Lengths in the unit of the points.
struct Sphere {
  Vector3 centre = Vector3::Zero();
  double radius = 0.0;
  /// covariance of centre x y z and radius; zero for 4 points
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  ResidualStatistics residuals;
  /// condition number of the Jacobian with lengths in units of the radius; large if the points
  /// cover only a flat cap
  double condition = 0.0;
  int iterations = 0;
};

/// Fits a sphere. NotFinite; TooFewObservations below 4 different points; DegenerateGeometry if
/// they lie in a plane, or on a cap so flat that rounding decides the result; NotConverged if the
/// iteration does not converge to a sphere. `known_sigma`: standard deviation of a point along the
/// normal, used for the covariance instead of that of the residuals.
[[nodiscard]] Result<Sphere> fit_sphere(std::span<const Vector3> points,
                                        std::optional<double> known_sigma = {});

}  // namespace abbe::calib::fit
