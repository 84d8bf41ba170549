#include "abbe/calib/internal/geometry/rigid_free_norm.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace abbe::calib {

RigidFreeNorm::RigidFreeNorm(const Eigen::MatrixXd& D, std::span<const Vector3> points_m) {
  const Eigen::Index rows = D.rows();
  Eigen::MatrixXd rigid(rows, 6);
  for (Eigen::Index i = 0; 3 * i < rows; ++i) {
    rigid.block<3, 3>(3 * i, 0).setIdentity();
    rigid.block<3, 3>(3 * i, 3) = rotation_effect(points_m[static_cast<std::size_t>(i)]);
  }
  const Eigen::MatrixXd basis =
      rigid.householderQr().householderQ() * Eigen::MatrixXd::Identity(rows, rigid.cols());
  const Eigen::MatrixXd shared = basis.transpose() * D;
  norm_ = (D.transpose() * D - shared.transpose() * shared) / static_cast<double>(points_m.size());
}

double RigidFreeNorm::rms_m(const Eigen::VectorXd& c) const {
  const auto model = c.head(norm_.rows());
  return std::sqrt(std::max(model.dot(norm_ * model), 0.0));
}

double RigidFreeNorm::rms_of_columns_m(const Eigen::MatrixXd& c) const {
  const auto model = c.topRows(norm_.rows());
  return std::sqrt(std::max((norm_ * model).cwiseProduct(model).sum(), 0.0));
}

double RigidFreeNorm::rms_u_m(const Eigen::MatrixXd& covariance) const {
  const auto model = covariance.topLeftCorner(norm_.rows(), norm_.rows());
  return std::sqrt(std::max(norm_.cwiseProduct(model).sum(), 0.0));
}

}  // namespace abbe::calib
