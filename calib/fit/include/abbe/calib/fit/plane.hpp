#pragma once
/// Plane by total least squares: the normal is the direction of the smallest singular value of the
/// centred points. The covariance assumes equal, independent noise of the points along the normal,
/// with a standard deviation computed from the residuals.

#include <optional>
#include <span>

#include "abbe/calib/fit/residuals.hpp"

namespace abbe::calib::fit {

/// Lengths in the unit of the points.
struct Plane {
  Vector3 point = Vector3::Zero();  ///< centroid of the points
  Vector3 normal = Vector3::UnitZ();
  Matrix3 cov_normal =
      Matrix3::Zero();    ///< rank 2: zero along the normal itself; all zero for 3 points
  double u_offset = 0.0;  ///< standard uncertainty of the plane's position along its normal
  ResidualStatistics residuals;
};

/// Fits a plane. The scalar product of the normal with the vector `towards` is positive. NotFinite;
/// TooFewObservations below 3 different points; DegenerateGeometry if the points lie on a line, or
/// if `towards` is parallel to the plane and does not determine the side. `known_sigma`: standard
/// deviation of a point along the normal, used instead of that of the residuals.
[[nodiscard]] Result<Plane> fit_plane(std::span<const Vector3> points, const Vector3& towards,
                                      std::optional<double> known_sigma = {});

/// Derivatives of point and normal with respect to a displacement of each point along the normal:
/// 6 x points. `points` are those of the fit.
[[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> derivatives_by_points(
    const Plane&, std::span<const Vector3> points);

}  // namespace abbe::calib::fit
