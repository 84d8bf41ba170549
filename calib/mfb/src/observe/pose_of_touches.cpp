#include "observe/pose_of_touches.hpp"

#include <Eigen/Cholesky>

namespace abbe::calib::mfb {
namespace {

constexpr double kAlongNormal_m = 0.2e-3, kAlongSurface_m = 1e-3;

Eigen::Matrix<double, 6, 6> information_of(const PosePrior& prior) {
  Eigen::Matrix<double, 6, 1> variances;
  variances.head<3>().setConstant(prior.shift_m * prior.shift_m);
  variances.tail<3>().setConstant(prior.rotation_rad * prior.rotation_rad);
  return variances.cwiseInverse().asDiagonal();
}

}  // namespace

PoseOfTouches::PoseOfTouches(const Vector3& origin_m, const PosePrior& prior)
    : origin_m_(origin_m), information_(information_of(prior)) {}

PoseOfTouches PoseOfTouches::with_prior(const PosePrior& prior) const {
  PoseOfTouches pose = *this;
  pose.information_ = information_of(prior);
  return pose;
}

PoseOfTouches::Matrix36 PoseOfTouches::derivative(const Vector3& planned_m) const {
  Matrix36 H;
  H << Matrix3::Identity(), rotation_effect(planned_m - origin_m_);
  return H;
}

Vector3 PoseOfTouches::expected_m(const Vector3& planned_m) const {
  return planned_m + derivative(planned_m) * pose_;
}

void PoseOfTouches::add(const Vector3& planned_m, const Vector3& normal, const Vector3& tip_m) {
  const Matrix3 along = normal * normal.transpose();
  const Matrix3 W = along / (kAlongNormal_m * kAlongNormal_m) +
                    (Matrix3::Identity() - along) / (kAlongSurface_m * kAlongSurface_m);
  const Matrix36 H = derivative(planned_m);
  information_ += H.transpose() * W * H;
  const Vector6 g = H.transpose() * (W * (tip_m - expected_m(planned_m)));
  pose_ += information_.llt().solve(g);
}

}  // namespace abbe::calib::mfb
