#include "solve/added_columns.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::otf {

AddedColumns::AddedColumns(std::size_t columns, std::size_t unknowns) {
  const auto k = static_cast<Eigen::Index>(columns), n = static_cast<Eigen::Index>(unknowns);
  CWC_ = Eigen::MatrixXd::Zero(k, k);
  CWA_ = Eigen::MatrixXd::Zero(k, n);
  CWr_ = Eigen::VectorXd::Zero(k);
}

void AddedColumns::add(const Observation& o, std::span<const SparseRows::Entry> row,
                       double residual_m, std::span<const double> values) {
  const Eigen::Map<const Eigen::VectorXd> c(values.data(),
                                            static_cast<Eigen::Index>(values.size()));
  const double weight = 1.0 / (o.sigma_m * o.sigma_m);
  CWC_.noalias() += weight * c * c.transpose();
  CWr_ += weight * residual_m * c;
  for (const SparseRows::Entry& e : row) {
    CWA_.col(static_cast<Eigen::Index>(e.column)) += weight * e.value * c;
  }
}

void AddedColumns::add(const Observation& o, std::span<const SparseRows::Entry> row,
                       double residual_m, std::span<const SparseRows::Entry> values) {
  const double weight = 1.0 / (o.sigma_m * o.sigma_m);
  for (const SparseRows::Entry& c : values) {
    const auto i = static_cast<Eigen::Index>(c.column);
    const double weighted = weight * c.value;
    for (const SparseRows::Entry& other : values) {
      CWC_(static_cast<Eigen::Index>(other.column), i) += weighted * other.value;
    }
    for (const SparseRows::Entry& e : row) {
      CWA_(i, static_cast<Eigen::Index>(e.column)) += weighted * e.value;
    }
    CWr_(i) += weighted * residual_m;
  }
}

void AddedColumns::add(const AddedColumns& part, const std::vector<std::size_t>& columns,
                       const std::vector<std::size_t>& unknowns) {
  CWC_(columns, columns) += part.CWC_;
  CWA_(columns, unknowns) += part.CWA_;
  CWr_(columns) += part.CWr_;
}

AddedColumns AddedColumns::first(std::size_t columns) const {
  const auto k = static_cast<Eigen::Index>(columns);
  AddedColumns part(columns, static_cast<std::size_t>(CWA_.cols()));
  part.CWC_ = CWC_.topLeftCorner(k, k);
  part.CWA_ = CWA_.topRows(k);
  part.CWr_ = CWr_.head(k);
  return part;
}

AddedColumns& AddedColumns::operator+=(const AddedColumns& other) {
  CWC_ += other.CWC_;
  CWA_ += other.CWA_;
  CWr_ += other.CWr_;
  return *this;
}

AddedColumns& AddedColumns::operator-=(const AddedColumns& other) {
  CWC_ -= other.CWC_;
  CWA_ -= other.CWA_;
  CWr_ -= other.CWr_;
  return *this;
}

AddedColumns::Estimate AddedColumns::estimate(const Eigen::MatrixXd& Q, double least_drop) const {
  const Eigen::MatrixXd QAWC = Q * CWA_.transpose();
  const Eigen::Index k = CWr_.size();

  // The columns are scaled to unit length. A combination of columns is not determined if the model
  // reproduces it except for 1e-6 of its squared length.
  constexpr double kFollowed = 1e-6;
  Eigen::VectorXd scale(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    scale(i) = CWC_(i, i) > 0.0 ? 1.0 / std::sqrt(CWC_(i, i)) : 0.0;
  }

  const Eigen::MatrixXd S = scale.asDiagonal() * (CWC_ - CWA_ * QAWC) * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (S + S.transpose()));
  const Eigen::VectorXd g = eigen.eigenvectors().transpose() * scale.asDiagonal() * CWr_;
  Estimate e;
  Eigen::VectorXd d = Eigen::VectorXd::Zero(k);
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(k, k);

  for (Eigen::Index i = 0; i < k; ++i) {
    const double value = eigen.eigenvalues()(i);
    if (value > kFollowed && g(i) * g(i) / value >= least_drop) {
      e.drop += g(i) * g(i) / value;
      d += g(i) / value * eigen.eigenvectors().col(i);
      root.col(i) = eigen.eigenvectors().col(i) / std::sqrt(value);
      ++e.columns;
    }
  }

  e.d = scale.asDiagonal() * d;
  e.root_cov_d = scale.asDiagonal() * root;
  e.u = e.root_cov_d.rowwise().norm();
  e.root_cov_dU = QAWC * e.root_cov_d;
  e.dU = QAWC * e.d;

  return e;
}

AddedColumns::Estimate AddedColumns::estimate_with_prior(const Eigen::MatrixXd& Q, double u,
                                                         double factor) const {
  return estimate_with_priors(Q, Eigen::VectorXd::Constant(CWr_.size(), u), factor);
}

AddedColumns::Estimate AddedColumns::estimate_with_priors(const Eigen::MatrixXd& Q,
                                                          const Eigen::VectorXd& u,
                                                          double factor) const {
  const Eigen::MatrixXd QAWC = Q * CWA_.transpose();
  const Eigen::Index k = CWr_.size();
  const Eigen::MatrixXd S = (CWC_ - CWA_ * QAWC) / factor;
  Eigen::MatrixXd information = 0.5 * (S + S.transpose());
  information.diagonal() += u.cwiseAbs2().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> llt(information);
  Estimate e;
  e.columns = static_cast<std::size_t>(k);
  e.d = llt.solve(CWr_ / factor);
  e.drop = e.d.dot(CWr_) / factor;
  e.twice_log_likelihood = e.drop;
  for (Eigen::Index i = 0; i < k; ++i) {
    e.twice_log_likelihood -= 2.0 * natural_logarithm(u(i) * llt.matrixLLT()(i, i));
  }
  e.root_cov_d = llt.matrixU().solve(Eigen::MatrixXd::Identity(k, k));
  e.u = e.root_cov_d.rowwise().norm();
  e.root_cov_dU = QAWC * e.root_cov_d;
  e.dU = QAWC * e.d;

  return e;
}

AddedColumns::Reduced AddedColumns::reduced(const Eigen::MatrixXd& Q) const {
  const Eigen::MatrixXd QAWC = Q * CWA_.transpose();
  const Eigen::MatrixXd S = CWC_ - CWA_ * QAWC;
  return {0.5 * (S + S.transpose()), CWr_, QAWC};
}

}  // namespace abbe::calib::otf
