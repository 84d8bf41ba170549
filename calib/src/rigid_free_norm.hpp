#pragma once
/// How large a volumetric error and its uncertainty are over some places, without rigid motion.

#include <Eigen/Core>
#include <span>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib {

/// V at the places is D c; without the best-fit rigid motion it is P D c. Holds D^T P D: the mean
/// square of what any c and any covariance bring there.
class RigidFreeNorm {
 public:
  /// `points_m`: where the rigid motion acts (axis position and tool offset); D: 3 rows each.
  RigidFreeNorm(const Eigen::MatrixXd& D, std::span<const Vector3> points_m);

  /// Root mean square length of D c. More coefficients than D has columns: the first count.
  [[nodiscard]] double rms_m(const Eigen::VectorXd& c) const;
  /// Root of the sum of squares of rms_m() of the columns.
  [[nodiscard]] double rms_of_columns_m(const Eigen::MatrixXd& c) const;
  /// Root mean square standard uncertainty: root of the trace.
  [[nodiscard]] double rms_u_m(const Eigen::MatrixXd& covariance) const;

 private:
  Eigen::MatrixXd norm_;
};

}  // namespace abbe::calib
