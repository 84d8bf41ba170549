#pragma once
/// Estimates the pose of a bar from the touches made so far (touch_guide.hpp).

#include <Eigen/Core>

#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

/// Standard deviations of the prior of a pose.
struct PosePrior {
  double shift_m = 0.0;
  double rotation_rad = 0.0;
};

class PoseOfTouches {
 public:
  PoseOfTouches(const Vector3& origin_m, const PosePrior& prior);
  /// The same pose as the start for another measurement of the same clamping, with the uncertainty
  /// `prior`.
  [[nodiscard]] PoseOfTouches with_prior(const PosePrior& prior) const;

  /// Expected centre of the tip. `planned_m`: centre of the tip at the planned pose.
  [[nodiscard]] Vector3 expected_m(const Vector3& planned_m) const;
  /// Adds a touch at `tip_m`. `normal`: outward normal of the surface.
  void add(const Vector3& planned_m, const Vector3& normal, const Vector3& tip_m);

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Matrix36 = Eigen::Matrix<double, 3, 6>;

  [[nodiscard]] Matrix36 derivative(const Vector3& planned_m) const;

  Vector3 origin_m_;
  Vector6 pose_ = Vector6::Zero();  ///< shift, rotation
  Matrix6 information_;
};

}  // namespace abbe::calib::mfb
