#include "abbe/calib/evemu/linear_gaussian.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "elementary.hpp"

namespace abbe::calib::evemu {
namespace {

constexpr double kLog2Pi = 1.8378770664093454836;  // log(2 pi)

}  // namespace

LinearGaussian::LinearGaussian(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S,
                               const Eigen::VectorXd& y)
    : unknowns_(X.cols()), rows_(X.rows()) {
  Eigen::MatrixXd Z(X.rows(), X.cols() + S.cols());
  Z << X, S;
  qr_.compute(Z);
  const Eigen::Index m = std::min(Z.rows(), Z.cols());
  R_ = qr_.matrixQR().topRows(m).triangularView<Eigen::Upper>();
  const Eigen::VectorXd turned = qr_.householderQ().adjoint() * y;
  z_ = turned.head(m);
  rest_ = turned.tail(Z.rows() - m).squaredNorm();
}

LinearGaussian::Evidence LinearGaussian::evidence(const Eigen::VectorXd& prior,
                                                  double noise) const {
  const Eigen::Index m = R_.rows(), out_of_reach = rows_ - m;
  // With [X S] = Q R and z = Q^T y, K = R diag(prior) R^T + s^2 I is the covariance of z. The part
  // of y perpendicular to Q contains only noise.
  const Eigen::MatrixXd scaled = R_ * prior.cwiseSqrt().asDiagonal();
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(m, m);
  K.selfadjointView<Eigen::Lower>().rankUpdate(scaled);
  K.diagonal().array() += noise;
  const Eigen::LLT<Eigen::MatrixXd> llt(K);
  Evidence e;

  if (llt.info() != Eigen::Success) {
    e.log_likelihood = -std::numeric_limits<double>::infinity();
    e.by_log_prior = Eigen::VectorXd::Zero(prior.size());
    return e;
  }

  const Eigen::MatrixXd L_inv_scaled = llt.matrixL().solve(scaled);
  const Eigen::VectorXd L_inv_z = llt.matrixL().solve(z_);
  const Eigen::VectorXd projected = L_inv_scaled.transpose() * L_inv_z;
  const double log_det = 2.0 * llt.matrixLLT().diagonal().unaryExpr(&natural_logarithm).sum();
  e.log_likelihood = -0.5 * (log_det + L_inv_z.squaredNorm() +
                             static_cast<double>(out_of_reach) * natural_logarithm(noise) +
                             rest_ / noise + static_cast<double>(rows_) * kLog2Pi);
  const Eigen::VectorXd used = L_inv_scaled.colwise().squaredNorm();
  e.by_log_prior = 0.5 * (projected.cwiseAbs2() - used);

  // The derivative by log s^2 needs trace(K^-1) s^2 = m - trace(K^-1 R D R^T), D = diag(prior), and
  // z^T K^-2 z = |K^-1 z|^2, for which one more triangular system is solved.
  const Eigen::VectorXd K_inv_z = llt.matrixU().solve(L_inv_z);
  e.by_log_noise = 0.5 * (noise * K_inv_z.squaredNorm() - (static_cast<double>(m) - used.sum()) +
                          rest_ / noise - static_cast<double>(out_of_reach));

  return e;
}

/// Posterior information matrix of the unknowns divided by their prior standard deviations. In this
/// scale no large and small variances are subtracted from each other.
struct LinearGaussian::Information {
  Eigen::VectorXd root;
  Eigen::MatrixXd scaled;
  Eigen::LLT<Eigen::MatrixXd> llt;
};

LinearGaussian::Information LinearGaussian::information(const Eigen::VectorXd& prior,
                                                        double noise) const {
  const Eigen::VectorXd root = prior.cwiseSqrt();
  const Eigen::MatrixXd scaled = R_ * root.asDiagonal() / std::sqrt(noise);
  const Eigen::Index n = R_.cols();
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
  information.selfadjointView<Eigen::Lower>().rankUpdate(scaled.transpose());
  return {root, scaled, Eigen::LLT<Eigen::MatrixXd>(information)};
}

Eigen::MatrixXd LinearGaussian::response(const Eigen::VectorXd& prior, double noise,
                                         const Eigen::MatrixXd& rows) const {
  const auto [root, scaled, llt] = information(prior, noise);
  if (llt.info() != Eigen::Success) {
    return Eigen::MatrixXd::Constant(R_.cols(), rows.cols(),
                                     std::numeric_limits<double>::quiet_NaN());
  }
  const Eigen::MatrixXd turned = qr_.householderQ().adjoint() * rows;
  return root.asDiagonal() *
         llt.solve(scaled.transpose() * (turned.topRows(R_.rows()) / std::sqrt(noise)));
}

LinearGaussian::Posterior LinearGaussian::posterior(const Eigen::VectorXd& prior,
                                                    double noise) const {
  const auto [root, scaled, llt] = information(prior, noise);
  const Eigen::Index n = R_.cols();
  Posterior p;

  if (llt.info() != Eigen::Success) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    return {Eigen::VectorXd::Constant(n, kNaN), Eigen::MatrixXd::Constant(n, n, kNaN), kNaN, kNaN};
  }

  const Eigen::MatrixXd inverse = llt.solve(Eigen::MatrixXd::Identity(n, n));
  p.covariance = root.asDiagonal() * inverse * root.asDiagonal();
  p.covariance = 0.5 * (p.covariance + p.covariance.transpose()).eval();
  p.mean = root.cwiseProduct(llt.solve(scaled.transpose() * (z_ / std::sqrt(noise))));

  // Degrees of freedom of column j: (inverse * scaled^T scaled)_jj = 1 - inverse_jj.
  const Eigen::VectorXd used = Eigen::VectorXd::Ones(n) - inverse.diagonal();
  p.effective_parameters = used.head(unknowns_).sum();
  p.effective_pose_parameters = used.tail(n - unknowns_).sum();

  return p;
}

}  // namespace abbe::calib::evemu
