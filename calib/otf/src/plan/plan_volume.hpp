#pragma once
/// The matrix G of plan_prediction.hpp: the mean square of V over the volume after removal of the
/// best-fit rigid motion, as a quadratic form of the parameters of tables.

#include <Eigen/Core>

#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::otf {

/// Computes root mean squares over the volume with G. Immutable.
class RigidFreeVolume {
 public:
  /// Uses the grid of the nodes, at most 13 per axis. t: target offset.
  RigidFreeVolume(const ParameterLayout&, const Vector3& t);

  /// Matrix of size model_size() x model_size().
  [[nodiscard]] const Eigen::MatrixXd& G() const { return G_; }
  /// sqrt(trace(G Cov)). `covariance`: its first model_size() rows and columns are used.
  [[nodiscard]] double rms_u_m(const Eigen::MatrixXd& covariance) const;
  /// Standard uncertainty of V at an axis position, without the rigid motion: root of the trace of
  /// its covariance.
  [[nodiscard]] double u_m(const Vector3& axis_position_m, const Eigen::MatrixXd& covariance) const;

 private:
  ParameterLayout layout_;
  Vector3 t_;
  Vector3 centre_m_ = Vector3::Zero();  ///< centre of the grid; the rotation is about it
  Eigen::MatrixXd rigid_of_U_;          ///< 6 x model_size(): best-fit rigid motion of V for given
                                        ///< U
  Eigen::MatrixXd G_;
};

}  // namespace abbe::calib::otf
