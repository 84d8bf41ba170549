#pragma once
/// Least-squares cylinder: minimises the sum of (distance of p_i from the axis - radius)^2 by
/// Gauss-Newton with small displacements of the axis. In the frame of the present axis, with p_i =
/// (r_i cos t_i, r_i sin t_i, z_i), a rotation (alpha, beta) about x and y, a shift (u, v) and a
/// change of the radius by w reduce the residuals r_i - radius by
///     -z_i sin t_i alpha + z_i cos t_i beta + cos t_i u + sin t_i v + w
/// [Viprey 2016, appendix A]. The covariance assumes equal, independent noise of the points along
/// the normal, with a standard deviation computed from the residuals.

#include <optional>
#include <span>

#include "abbe/calib/fit/residuals.hpp"

namespace abbe::calib::fit {

/// Lengths in the unit of the points.
struct Cylinder {
  Vector3 point = Vector3::Zero();  ///< projection of the centroid of the points on the axis
  Vector3 direction = Vector3::UnitZ();
  double radius = 0.0;
  /// covariance of point x y z, direction x y z and radius: rank 5; zero for 5 points. The part of
  /// the point contains no displacement along the axis; the part of the direction is zero along the
  /// axis
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  ResidualStatistics residuals;  ///< negative residual: point inside
  /// condition number of the Jacobian with lengths in units of the size of the points
  double condition = 0.0;
  int iterations = 0;
};

/// `near`: approximate direction of the axis, preferably the nominal one; the scalar product with
/// the result is positive. A fit from a direction that is 70 degrees off finds the best cylinder in
/// one of five cases. Without `near` the fit starts with many directions of the hemisphere and
/// takes the cylinder with the smallest residuals; the largest component of its direction is
/// positive. NotFinite; TooFewObservations below 5 different points; DegenerateGeometry if they lie
/// on a line, in a plane, or so that rounding decides the result (for example two points in each
/// section); NotConverged if no iteration converges. `known_sigma`: standard deviation of a point
/// along the normal, used for the covariance instead of that of the residuals.
[[nodiscard]] Result<Cylinder> fit_cylinder(std::span<const Vector3> points,
                                            std::optional<Vector3> near = {},
                                            std::optional<double> known_sigma = {});

/// Derivatives of point, direction and radius, in the order of Cylinder::covariance, with respect
/// to a displacement of each point along the outward normal: 7 x points. `points` are those of the
/// fit.
[[nodiscard]] Eigen::Matrix<double, 7, Eigen::Dynamic> derivatives_by_points(
    const Cylinder&, std::span<const Vector3> points);

}  // namespace abbe::calib::fit
