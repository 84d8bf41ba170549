#include "abbe/calib/fit/plane.hpp"

#include <Eigen/LU>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::fit {

Result<Plane> fit_plane(std::span<const Vector3> points, const Vector3& towards,
                        std::optional<double> known_sigma) {
  constexpr std::size_t kUnknowns = 3;
  const Result<PointSet> set = point_set(points, kUnknowns, "plane");
  ABBE_TRY(set);

  if (set->on_a_line()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("plane: the ", points.size(), " points lie on a line (extents ",
                           set->singular_values.transpose(), ")"));
  }

  Plane plane;
  plane.point = set->centroid;
  plane.normal = set->directions.col(2);
  const double side = plane.normal.dot(towards);

  if (!(std::abs(side) > PointSet::kDegenerate * towards.norm())) {
    return failure(
        ErrorCode::DegenerateGeometry,
        "plane: the given outward direction lies in the plane and does not tell its sides apart");
  }

  if (side < 0) {
    plane.normal = -plane.normal;
  }

  plane.residuals = residual_statistics(set->centred.transpose() * plane.normal, kUnknowns);
  const double sigma = known_sigma.value_or(plane.residuals.sigma0);
  for (Eigen::Index i = 0; i < 2; ++i) {
    const double u_tilt = sigma / set->singular_values(i);
    plane.cov_normal.noalias() +=
        u_tilt * u_tilt * set->directions.col(i) * set->directions.col(i).transpose();
  }

  plane.u_offset = sigma / std::sqrt(static_cast<double>(points.size()));
  return plane;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> derivatives_by_points(const Plane& plane,
                                                               std::span<const Vector3> points) {
  const Eigen::Index n = std::ssize(points);
  Eigen::Matrix3Xd centred(3, n);
  for (std::size_t i = 0; i < points.size(); ++i) {
    centred.col(static_cast<Eigen::Index>(i)) = points[i] - plane.point;
  }

  // Displacements of the points along the normal rotate it by small angles (a, b) about the axes
  // e1, e2 of the plane. (a, b) is the regression of the displacements on the positions in the
  // plane.
  const Vector3 e1 = plane.normal.unitOrthogonal(), e2 = plane.normal.cross(e1);
  Eigen::Matrix<double, 2, Eigen::Dynamic> q(2, n);
  q << e1.transpose() * centred, e2.transpose() * centred;
  const Eigen::Matrix<double, 2, Eigen::Dynamic> slope = (q * q.transpose()).inverse() * q;

  Eigen::Matrix<double, 6, Eigen::Dynamic> D(6, n);
  D.topRows<3>() = plane.normal * Eigen::RowVectorXd::Constant(n, 1.0 / static_cast<double>(n));
  D.bottomRows<3>() = -e1 * slope.row(0) - e2 * slope.row(1);
  return D;
}

}  // namespace abbe::calib::fit
