#include "plan/plan_volume.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "run/sparse_grid.hpp"

namespace abbe::calib::otf {
namespace {

constexpr std::size_t kVolumeCells = 12;  // cells per axis
using RigidColumns = Eigen::Matrix<double, 3, 6>;

RigidColumns rigid_columns(const Vector3& from_centre_m) {
  RigidColumns E;
  E << Matrix3::Identity(), rotation_effect(from_centre_m);
  return E;
}

}  // namespace

RigidFreeVolume::RigidFreeVolume(const ParameterLayout& layout, const Vector3& t)
    : layout_(layout), t_(t) {
  const std::vector<Vector3> grid = sparse_grid(layout.nodes(), kVolumeCells);
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  const auto places = static_cast<double>(grid.size());
  for (const Vector3& q : grid) {
    centre_m_ += q / places;
  }

  // Normal matrices of the rigid motion x (N x = F U) and of V itself.
  G_ = Eigen::MatrixXd::Zero(n, n);
  Eigen::MatrixXd F = Eigen::MatrixXd::Zero(6, n);
  Eigen::Matrix<double, 6, 6> N = Eigen::Matrix<double, 6, 6>::Zero();
  for (const Vector3& q : grid) {
    const RigidColumns E = rigid_columns(q - centre_m_);
    const DesignColumns columns = design_columns(layout, q, t);
    N.noalias() += E.transpose() * E;
    for (const Column& a : columns.span()) {
      F.col(static_cast<Eigen::Index>(a.parameter)) += E.transpose() * a.dV_dU;
      for (const Column& b : columns.span()) {
        G_(static_cast<Eigen::Index>(a.parameter), static_cast<Eigen::Index>(b.parameter)) +=
            a.dV_dU.dot(b.dV_dU);
      }
    }
  }

  rigid_of_U_ = N.ldlt().solve(F);
  const Eigen::MatrixXd rigid = F.transpose() * rigid_of_U_;
  G_ = (G_ - 0.5 * (rigid + rigid.transpose())) / places;
}

double RigidFreeVolume::rms_u_m(const Eigen::MatrixXd& covariance) const {
  const auto model = covariance.topLeftCorner(G_.rows(), G_.rows());
  return std::sqrt(std::max(G_.cwiseProduct(model).sum(), 0.0));
}

double RigidFreeVolume::u_m(const Vector3& q, const Eigen::MatrixXd& covariance) const {
  Eigen::MatrixXd B = -rigid_columns(q - centre_m_) * rigid_of_U_;
  const DesignColumns columns = design_columns(layout_, q, t_);
  for (const Column& c : columns.span()) {
    B.col(static_cast<Eigen::Index>(c.parameter)) += c.dV_dU;
  }

  const Eigen::MatrixXd BC = B * covariance.topLeftCorner(G_.rows(), G_.rows());
  return std::sqrt(std::max(BC.cwiseProduct(B).sum(), 0.0));
}

}  // namespace abbe::calib::otf
