#pragma once
/// Fast estimate of the likelihood ratio for columns added to the design of a ball array. The
/// estimate needs no fit for each candidate, so that one of many candidates can be selected.

#include <Eigen/Core>
#include <array>

namespace abbe::calib::evemu {

/// Computes likelihood ratios from one QR decomposition. With the hyper-parameters of an estimate,
/// the observed errors y have the covariance s^2 1 + U U^T. U: columns of design, pose rotations
/// and array, each times its prior standard deviation. Q R is the QR decomposition of the stacked
/// matrix [U; s 1]; Q1: the rows of Q that belong to U. Then
///     (s^2 1 + U U^T)^-1 = (1 - Q1 Q1^T) / s^2.
class Screen {
 public:
  /// Prior standard deviations of a displacement for which the gain is computed.
  static constexpr std::array<double, 4> kSizes_m{10e-6, 30e-6, 100e-6, 300e-6};

  /// Whitened rows of design X, pose rotations S, array A (one column per standard uncertainty) and
  /// errors y [m]; `prior`: variances of X, then S; `s_m`: noise of a ball centre. O(n m^2) for n
  /// rows and m columns.
  Screen(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S, const Eigen::MatrixXd& A,
         const Eigen::VectorXd& y, const Eigen::VectorXd& prior, double s_m);

  struct Gain {
    double log_likelihood = 0.0;  ///< natural logarithm of the ratio
    double size_m = 0.0;
  };
  /// Likelihood gained by adding the whitened columns C, with the prior of kSizes_m that gives the
  /// largest gain. NaN if the likelihood cannot be computed.
  [[nodiscard]] Gain gain(const Eigen::MatrixXd& C) const;

 private:
  Eigen::VectorXd y_;
  double s2_;
  Eigen::MatrixXd Q1_;
  Eigen::VectorXd Q1_y_;
};

}  // namespace abbe::calib::evemu
