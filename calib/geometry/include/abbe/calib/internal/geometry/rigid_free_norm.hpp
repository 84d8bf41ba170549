#pragma once
/// Root mean squares of V over a set of places, without rigid motion.

#include <Eigen/Core>
#include <span>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// Root mean squares of V and of its uncertainty over n places, after removal of the best-fit rigid
/// motion. V at the places is D c, c: coefficients of a model; after the removal it is P D c, P:
/// projection. The class stores D^T P D / n, from which the mean squares for any c and for any
/// covariance of c follow.
class RigidFreeNorm {
 public:
  /// `points_m`: points at which the rigid motion acts (axis position + tool offset). D: 3 rows per
  /// point.
  RigidFreeNorm(const Eigen::MatrixXd& D, std::span<const Vector3> points_m);

  /// Root mean square length of P D c. If c has more entries than D has columns, the last entries
  /// are ignored.
  [[nodiscard]] double rms_m(const Eigen::VectorXd& c) const;
  /// Root sum of squares of rms_m() over the columns of `c`.
  [[nodiscard]] double rms_of_columns_m(const Eigen::MatrixXd& c) const;
  /// Root mean square of the standard uncertainty of V for a covariance of c (root of the trace).
  [[nodiscard]] double rms_u_m(const Eigen::MatrixXd& covariance) const;

 private:
  Eigen::MatrixXd norm_;
};

}  // namespace abbe::calib
