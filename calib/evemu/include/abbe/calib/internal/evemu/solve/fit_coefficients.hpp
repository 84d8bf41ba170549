#pragma once
/// Input and output of every estimator of coefficients: plain numbers on the scaled design.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "abbe/calib/evemu/solve/solve.hpp"

namespace abbe::calib::evemu {

struct FitProblem {
  const Observations& observations;
  const ScaledDesign& design;
  Eigen::MatrixXd X;  ///< rows before whitening
  Eigen::VectorXd y;
  bool from_touches = false;
  Eigen::MatrixXd A{};  ///< the matrix artefact_rows()
};

struct Fit {
  Eigen::VectorXd c_m;
  Eigen::MatrixXd covariance_m2;
  /// Effect on the coefficients c of one standard uncertainty of each error of the array, one
  /// column for each: K A, where c = K y and A = artefact_rows(). Not included in covariance_m2. No
  /// columns if the array is exact, or if covariance_m2 includes the effect (bootstrap).
  Eigen::MatrixXd artefact_m{};
  CovarianceKind kind = CovarianceKind::Analytic;
  std::optional<HyperParameters> hyper;
  std::optional<SparseChoice> sparse;
  std::vector<Vector3> pose_rotations_rad;
  Matrix3 cov_mean_pose_rotation_rad2 = Matrix3::Zero();
  double s_m = 0.0, w_rad = 0.0;
  double effective_parameters = 0.0, pose_parameters = 0.0;
  int iterations = 0;
};

/// Singular values of the design with columns of unit length, relative to the largest, are about
/// 1e-7 for rotations that the positions do not show (not 0, because readings of Ball1 differ by
/// nanometres), and 1e-4 and more for determined coefficients.
inline constexpr double kUndetermined = 1e-6;

/// whitened() rows without those of Ball1, whose error is zero by definition.
[[nodiscard]] Eigen::MatrixXd white_rows(const Observations&, const Eigen::MatrixXd& rows);

/// Input of the estimators from these observations. The design may be scaled to the readings of
/// more positions than the observations contain.
[[nodiscard]] FitProblem problem_of(const Observations&, const ScaledDesign&, const SolveOptions&);
[[nodiscard]] Result<Fit> fit_with(const FitProblem&, const SolveOptions&);

/// Enlarges the covariance of a fit of the estimator bayes-pose until the uncertainty covers the
/// estimates with all comparable_parameters(). Returns the largest rms difference of V over the
/// balls [m].
double cover_comparable(Fit&, const FitProblem&);

[[nodiscard]] Result<Fit> fit_ols(const FitProblem&);
[[nodiscard]] Result<Fit> fit_sparse(const FitProblem&, const SolveOptions&);
[[nodiscard]] Result<Fit> fit_prior(PriorKind, const FitProblem&);

}  // namespace abbe::calib::evemu
