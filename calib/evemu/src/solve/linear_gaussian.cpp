#include "abbe/calib/evemu/solve/linear_gaussian.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "abbe/calib/internal/estimation/considered.hpp"
#include "abbe/calib/internal/estimation/dense_information.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::evemu {
namespace {

constexpr double kLog2Pi = 1.8378770664093454836;  // log(2 pi)

}  // namespace

LinearGaussian::LinearGaussian(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S,
                               const Eigen::VectorXd& y)
    : LinearGaussian(X, S, Eigen::MatrixXd(X.rows(), 0), y) {}

LinearGaussian::LinearGaussian(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S,
                               const Eigen::MatrixXd& A, const Eigen::VectorXd& y)
    : unknowns_(X.cols()), rows_(X.rows()) {
  const Eigen::Index n = X.cols() + S.cols();
  Eigen::MatrixXd Z(X.rows(), n + A.cols());
  Z << X, S, A;
  const estimation::Information data = estimation::information_of(Z, y);
  const Eigen::MatrixXd R = data.R();
  const Eigen::VectorXd z = data.z();
  R_ = R.topLeftCorner(n, n);
  R_a_ = R.topRightCorner(n, A.cols());
  z_ = z.head(n);
  rest_ = data.rest() + z.tail(A.cols()).squaredNorm();
}

LinearGaussian::Evidence LinearGaussian::evidence(const Eigen::VectorXd& prior,
                                                  double noise) const {
  const Eigen::Index m = R_.rows(), out_of_reach = rows_ - m;
  // K = R diag(prior) R^T + s^2 I is the covariance of z. The part of y outside the span of [X S]
  // contains only noise.
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

/// Information about the unknowns divided by their prior standard deviations, and about quantities
/// with the columns `considered` (R_a_ or none). In this scale no large and small variances are
/// subtracted from each other.
estimation::Information LinearGaussian::with_prior(const Eigen::VectorXd& prior, double noise,
                                                   const Eigen::MatrixXd& considered) const {
  const Eigen::Index n = R_.cols();
  Eigen::MatrixXd rows(n, n + considered.cols());
  rows << R_ * prior.cwiseSqrt().asDiagonal(), considered;
  estimation::Information information(static_cast<std::size_t>(rows.cols()));
  information.add_rows(rows / std::sqrt(noise), z_ / std::sqrt(noise));

  rows.setIdentity();
  information.add_rows(rows, Eigen::VectorXd::Zero(n));
  return information;
}

Eigen::MatrixXd LinearGaussian::response(const Eigen::VectorXd& prior, double noise) const {
  return prior.cwiseSqrt().asDiagonal() *
         estimation::sensitivity(with_prior(prior, noise, R_a_),
                                 static_cast<std::size_t>(R_.cols()));
}

LinearGaussian::Posterior LinearGaussian::posterior(const Eigen::VectorXd& prior,
                                                    double noise) const {
  const Eigen::Index n = R_.cols();
  const estimation::Information information = with_prior(prior, noise, Eigen::MatrixXd(n, 0));
  const Eigen::MatrixXd R_inverse =
      information.R().triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd root = prior.cwiseSqrt().asDiagonal() * R_inverse;

  Posterior p;
  p.mean = root * information.z();
  p.covariance = Eigen::MatrixXd::Zero(n, n);
  p.covariance.selfadjointView<Eigen::Lower>().rankUpdate(root);
  p.covariance.triangularView<Eigen::StrictlyUpper>() = p.covariance.transpose();

  // Degrees of freedom of column j: 1 - (posterior variance / prior variance).
  const Eigen::VectorXd used = 1.0 - R_inverse.rowwise().squaredNorm().array();
  p.effective_parameters = used.head(unknowns_).sum();
  p.effective_pose_parameters = used.tail(n - unknowns_).sum();

  return p;
}

}  // namespace abbe::calib::evemu
