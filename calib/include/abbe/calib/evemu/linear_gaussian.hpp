#pragma once
/// y = X b + S omega + n with Gaussian priors: the algebra behind the Bayesian estimators, and
/// nothing that knows what the numbers mean.
///     b ~ N(0, diag v),  omega ~ N(0, w^2 I),  n ~ N(0, s^2 I)  after whitening.
/// One QR of [X S] turns an evaluation of the marginal likelihood from N^3 into (columns)^3, with gradient.

#include <Eigen/Core>
#include <Eigen/QR>
#include <span>

namespace abbe::calib::evemu {

/// Whitened rows.
class LinearGaussian {
 public:
  LinearGaussian(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S, const Eigen::VectorXd& y);

  [[nodiscard]] Eigen::Index columns() const { return R_.cols(); }   ///< of [X S]
  [[nodiscard]] Eigen::Index unknowns() const { return unknowns_; }  ///< of X
  [[nodiscard]] Eigen::Index rows() const { return rows_; }

  struct Evidence {
    /// Of y, natural logarithm. Minus infinity, with derivatives of zero, where rounding leaves no
    /// covariance of y (noise 1e-8 of what the prior makes of it): nothing is known there, least of
    /// all a maximum.
    double log_likelihood = 0.0;
    Eigen::VectorXd by_log_prior;  ///< derivative by the logarithm of each column's prior variance
    double by_log_noise = 0.0;     ///< by log s^2
  };
  /// `prior`: variance of every column of [X S]; may contain zeros.
  [[nodiscard]] Evidence evidence(const Eigen::VectorXd& prior, double noise_variance) const;

  struct Posterior {
    Eigen::VectorXd mean;                    ///< of b and omega
    Eigen::MatrixXd covariance;              ///< of both, columns() squared
    double effective_parameters = 0.0;       ///< trace of d(X b)/dy: degrees of freedom b spends
    double effective_pose_parameters = 0.0;  ///< the same of omega
  };
  /// NaN where rounding leaves no posterior information matrix.
  [[nodiscard]] Posterior posterior(const Eigen::VectorXd& prior, double noise_variance) const;

  /// What the mean would be with each column of `rows` (whitened) in the place of y: the mean is
  /// linear in y. NaN where rounding leaves no posterior information matrix.
  [[nodiscard]] Eigen::MatrixXd response(const Eigen::VectorXd& prior, double noise_variance,
                                         const Eigen::MatrixXd& rows) const;

 private:
  struct Information;
  [[nodiscard]] Information information(const Eigen::VectorXd& prior, double noise_variance) const;

  Eigen::HouseholderQR<Eigen::MatrixXd> qr_;
  Eigen::MatrixXd R_;  ///< [X S] = Q R
  Eigen::VectorXd z_;  ///< Q^T y
  double rest_ = 0.0;  ///< |y|^2 - |z|^2, what no column reaches
  Eigen::Index unknowns_ = 0, rows_ = 0;
};

}  // namespace abbe::calib::evemu
