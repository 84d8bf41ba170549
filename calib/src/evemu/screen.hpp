#pragma once
/// How much more likely added columns would make the errors of a ball array, without a fit of its
/// own for each: for the choice among many.

#include <Eigen/Core>
#include <array>

namespace abbe::calib::evemu {

/// At the hyper-parameters of an estimate y has the covariance s^2 1 + U U^T, U: columns of design,
/// pose rotations and array, each times its prior standard deviation. With Q1 the upper rows of Q,
/// (U above s 1) = Q R,
///     (s^2 1 + U U^T)^-1 = (1 - Q1 Q1^T) / s^2.
class Screen {
 public:
  /// Prior standard deviations of a displacement that are tried.
  static constexpr std::array<double, 4> kSizes_m{10e-6, 30e-6, 100e-6, 300e-6};

  /// White rows of design X, pose rotations S, array A (in its standard uncertainties) and errors y
  /// [m]; `prior`: variances of X, then S; s_m: of a ball centre. O(n m^2) for n rows and m
  /// columns.
  Screen(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S, const Eigen::MatrixXd& A,
         const Eigen::VectorXd& y, const Eigen::VectorXd& prior, double s_m);

  struct Gain {
    double log_likelihood = 0.0;  ///< natural logarithm of the ratio
    double size_m = 0.0;
  };
  /// Of the white columns C, by the best of kSizes_m. NaN: there is no likelihood.
  [[nodiscard]] Gain gain(const Eigen::MatrixXd& C) const;

 private:
  Eigen::VectorXd y_;
  double s2_;
  Eigen::MatrixXd Q1_;
  Eigen::VectorXd Q1_y_;
};

}  // namespace abbe::calib::evemu
