#pragma once
/// The linear algebra of the Bayesian estimators: likelihood and posterior of the linear model with
/// observations y, unknowns b and omega, and noise n
///     y = X b + S omega + n,
///     b ~ N(0, diag v),  omega ~ N(0, w^2 I),  n ~ N(0, s^2 I)  after whitening.
/// The class stores the information of y about b and omega as one Information
/// (estimation/information.hpp). This reduces the cost of each evaluation of the marginal
/// likelihood, with gradient, from N^3 to (columns)^3. The storey `estimation` has no such
/// likelihood: v, w and s are unknown here, so that neither prior nor noise can be part of the
/// Information.

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::evemu {

/// Likelihood and posterior for given variances. All rows must be whitened.
class LinearGaussian {
 public:
  LinearGaussian(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S, const Eigen::VectorXd& y);
  /// `A`: columns of quantities that y may contain and that are not estimated (response()).
  LinearGaussian(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S, const Eigen::MatrixXd& A,
                 const Eigen::VectorXd& y);

  [[nodiscard]] Eigen::Index columns() const { return R_.cols(); }   ///< number of columns of [X S]
  [[nodiscard]] Eigen::Index unknowns() const { return unknowns_; }  ///< number of columns of X
  [[nodiscard]] Eigen::Index rows() const { return rows_; }

  struct Evidence {
    /// Natural logarithm of the marginal likelihood of y. Minus infinity, with derivatives of zero,
    /// if the covariance of y is not positive definite after rounding (if the noise is 1e-8 of the
    /// part that comes from the prior). The likelihood is then unknown; minus infinity keeps a
    /// search for the maximum away from such priors.
    double log_likelihood = 0.0;
    Eigen::VectorXd by_log_prior;  ///< derivative by the logarithm of each column's prior variance
    double by_log_noise = 0.0;     ///< derivative of log_likelihood by log s^2
  };
  /// `prior`: variance of every column of [X S]; may contain zeros.
  [[nodiscard]] Evidence evidence(const Eigen::VectorXd& prior, double noise_variance) const;

  struct Posterior {
    Eigen::VectorXd mean;                    ///< mean of b, then omega
    Eigen::MatrixXd covariance;              ///< covariance of b and omega, columns() x columns()
    double effective_parameters = 0.0;       ///< trace of d(X b)/dy: degrees of freedom of b
    double effective_pose_parameters = 0.0;  ///< trace of d(S omega)/dy: degrees of freedom of
                                             ///< omega
  };
  /// Posterior of b and omega. Not finite if the noise is zero.
  [[nodiscard]] Posterior posterior(const Eigen::VectorXd& prior, double noise_variance) const;

  /// Effect of each column of A in y on the posterior mean: columns() x columns of A.
  [[nodiscard]] Eigen::MatrixXd response(const Eigen::VectorXd& prior, double noise_variance) const;

 private:
  [[nodiscard]] estimation::Information with_prior(const Eigen::VectorXd& prior,
                                                   double noise_variance,
                                                   const Eigen::MatrixXd& considered) const;

  Eigen::MatrixXd R_, R_a_;  ///< [X S A] = Q [R R_a; 0 ...]
  Eigen::VectorXd z_;        ///< part of Q^T y that belongs to R
  double rest_ = 0.0;        ///< |y|^2 - |z|^2, the part of y outside the span of [X S]
  Eigen::Index unknowns_ = 0, rows_ = 0;
};

}  // namespace abbe::calib::evemu
