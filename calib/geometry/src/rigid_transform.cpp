#include "abbe/calib/geometry/rigid_transform.hpp"

#include <Eigen/SVD>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib {

Vector3 from_spherical(double range_m, double azimuth_rad, double elevation_rad) {
  const SinCos azimuth = sin_cos(azimuth_rad), elevation = sin_cos(elevation_rad);
  const double in_plane_m = range_m * elevation.cos;
  return {in_plane_m * azimuth.cos, in_plane_m * azimuth.sin, range_m * elevation.sin};
}

Result<Matrix3> rotation_from_cross_covariance(const Matrix3& cross) {
  const Eigen::JacobiSVD<Matrix3> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3& s = svd.singularValues();
  // For points on a line the second singular value consists of rounding errors, and the rotation
  // about the line is not determined.
  constexpr double kFlat = 1e-9;
  if (!(s(1) > kFlat * s(0))) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("best-fit rotation: the points lie on a line (singular values ", s(0),
                           ", ", s(1), ")"));
  }
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0 ? -1.0 : 1.0;
  return Matrix3(svd.matrixU() * Vector3(1, 1, sign).asDiagonal() * svd.matrixV().transpose());
}

Result<RigidTransform> fit_rigid(std::span<const Vector3> from_m, std::span<const Vector3> to_m) {
  if (from_m.size() != to_m.size() || from_m.size() < 3) {
    return failure(ErrorCode::TooFewObservations, message("rigid fit of ", from_m.size(), " to ",
                                                          to_m.size(), " points: needs 3 pairs"));
  }

  Vector3 from_mean = Vector3::Zero(), to_mean = Vector3::Zero();
  for (std::size_t i = 0; i < from_m.size(); ++i) {
    from_mean += from_m[i];
    to_mean += to_m[i];
  }

  from_mean /= static_cast<double>(from_m.size());
  to_mean /= static_cast<double>(to_m.size());
  Matrix3 cross = Matrix3::Zero();

  for (std::size_t i = 0; i < from_m.size(); ++i) {
    cross.noalias() += (to_m[i] - to_mean) * (from_m[i] - from_mean).transpose();
  }

  return rotation_from_cross_covariance(cross).map([&](const Matrix3& R) {
    return RigidTransform{R, to_mean - R * from_mean};
  });
}

Matrix3 rotation_effect(const Vector3& lever_m) {
  const double x = lever_m.x(), y = lever_m.y(), z = lever_m.z();
  Matrix3 E;
  E << 0, z, -y, -z, 0, x, y, -x, 0;
  return E;
}

}  // namespace abbe::calib
