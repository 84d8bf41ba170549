#pragma once
/// Checks of the points before a fit, with limits relative to the size of the point set: the points
/// are finite and different. The caller then checks that they do not lie on a line or in a plane,
/// as the fitted surface requires.

#include <Eigen/Core>
#include <span>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::fit {

struct PointSet {
  Vector3 centroid = Vector3::Zero();
  Eigen::Matrix3Xd centred;  ///< one column per point, relative to the centroid
  /// principal directions of the points as columns, that of the longest extent first
  Matrix3 directions = Matrix3::Identity();
  Vector3 singular_values = Vector3::Zero();  ///< in descending order
  double size = 0.0;                          ///< largest distance from the centroid
  std::size_t distinct = 0;

  /// Limit for on_a_line() and in_a_plane(): second or third singular value divided by the first.
  static constexpr double kDegenerate = 1e-9;
  [[nodiscard]] bool on_a_line() const {
    return !(singular_values(1) > kDegenerate * singular_values(0));
  }
  [[nodiscard]] bool in_a_plane() const {
    return !(singular_values(2) > kDegenerate * singular_values(0));
  }
};

/// Computes the PointSet. NotFinite; TooFewObservations with fewer than `needed` different points.
/// The error text begins with `what`, the name of the fit.
[[nodiscard]] Result<PointSet> point_set(std::span<const Vector3> points, std::size_t needed,
                                         const char* what);

}  // namespace abbe::calib::fit
