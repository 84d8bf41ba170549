#pragma once
/// Vectors, rigid motions and the best-fit rotation between two point sets. Lengths in m, angles in
/// rad.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <span>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Rigid motion p_to = R * p_from + t_m. The name of a variable is T_to_from (`T_machine_tracker`).
struct RigidTransform {
  Matrix3 R = Matrix3::Identity();
  Vector3 t_m = Vector3::Zero();
  [[nodiscard]] Vector3 operator*(const Vector3& p_from_m) const { return R * p_from_m + t_m; }
};

/// Cartesian point from the spherical coordinates of a tracker: azimuth = atan2(y, x), elevation
/// from the xy plane.
[[nodiscard]] Vector3 from_spherical(double range_m, double azimuth_rad, double elevation_rad);

/// The rotation R that minimises
///     sum |to_i - R from_i|^2   for   cross = sum to_i from_i^T
/// ([Kabsch 1976], the method named in [Sanders 2023] section 1.2.3). det R is always +1, so that R
/// is never a reflection. DegenerateGeometry if the points lie on a line: then the rotation is not
/// determined.
[[nodiscard]] Result<Matrix3> rotation_from_cross_covariance(const Matrix3& cross);

/// R and t that minimise sum |to_i - (R from_i + t)|^2. Both spans have the same length >= 3.
[[nodiscard]] Result<RigidTransform> fit_rigid(std::span<const Vector3> from_m,
                                               std::span<const Vector3> to_m);

/// Matrix E = [p]_x^T of a lever p, so that a small rotation vector v displaces the end of the
/// lever by v x p = E v.
[[nodiscard]] Matrix3 rotation_effect(const Vector3& lever_m);

}  // namespace abbe::calib
