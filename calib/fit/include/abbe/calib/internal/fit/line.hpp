#pragma once
/// Straight line in space by total least squares: the direction is that of the largest singular
/// value of the centred points. The covariance assumes equal, independent noise of the points in
/// both directions across the line, with a standard deviation computed from the residuals.

#include <optional>
#include <span>

#include "abbe/calib/fit/residuals.hpp"

namespace abbe::calib::fit {

/// Lengths in the unit of the points.
struct Line {
  Vector3 point = Vector3::Zero();  ///< centroid of the points
  Vector3 direction = Vector3::UnitX();
  /// covariance of `point` across the line and of `direction`: rank 2, zero along the line; all
  /// zero for 2 points
  Matrix3 cov_point = Matrix3::Zero();
  Matrix3 cov_direction = Matrix3::Zero();
  /// Statistics of the distances of the points from the line, which are not negative; 2 n - 4
  /// degrees of freedom.
  ResidualStatistics residuals;
};

/// Fits a line. The scalar product of the direction with the vector `towards` is positive.
/// NotFinite; TooFewObservations below 2 different points; DegenerateGeometry if the points extend
/// equally in two directions, or if `towards` is perpendicular to the line and does not determine
/// its direction. `known_sigma`: standard deviation of a point in one direction across the line,
/// used instead of that of the residuals.
[[nodiscard]] Result<Line> fit_line(std::span<const Vector3> points, const Vector3& towards,
                                    std::optional<double> known_sigma = {});

}  // namespace abbe::calib::fit
