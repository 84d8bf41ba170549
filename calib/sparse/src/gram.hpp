#pragma once
/// One regression problem in the form that coordinate descent uses: inner products of standardised
/// columns and centred y.

#include <Eigen/Core>

#include "abbe/calib/internal/sparse/standardise.hpp"

namespace abbe::calib::sparse {

struct GramProblem {
  Standardised design;
  double y_mean = 0.0;
  double y_rms = 0.0;    ///< root mean square about the mean
  Eigen::VectorXd y;     ///< y minus its mean
  Eigen::MatrixXd gram;  ///< X' X / n; exactly symmetric
  Eigen::VectorXd xty;   ///< X' y / n

  [[nodiscard]] Eigen::Index columns() const { return xty.size(); }
  [[nodiscard]] double lambda_max() const { return xty.cwiseAbs().maxCoeff(); }
};

/// Makes the problem. BadInput, NotFinite, TooFewObservations as fit_path().
[[nodiscard]] Result<GramProblem> gram_problem(const Eigen::MatrixXd& X, const Eigen::VectorXd& y);

}  // namespace abbe::calib::sparse
