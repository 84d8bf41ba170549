#pragma once
/// Computes uncertainties of many sets of positions, to choose among them. It uses the normal
/// matrix, which loses digits; the final result is computed by PlanPredictor.

#include <span>

#include "abbe/calib/internal/mfb/solve/shared_unknowns.hpp"
#include "abbe/calib/mfb/plan/plan_prediction.hpp"

namespace abbe::calib::mfb {

class SetProblem {
 public:
  SetProblem(const Observations&, const SolveOptions&);

  [[nodiscard]] Eigen::MatrixXd information(std::span<const PositionInformation* const>) const;

  /// Covariance of a set, and its product with the derivatives of the parameters.
  struct State {
    Eigen::MatrixXd C, B;
    Eigen::VectorXd u2;  ///< squared uncertainty of each parameter of the model / its squared limit
  };
  [[nodiscard]] State state_of(const Eigen::MatrixXd& information) const;

  /// Derivative of the sum in merit() by the information matrix, as a matrix G: rows A change the
  /// sum by minus trace(A G A^T).
  [[nodiscard]] static Eigen::MatrixXd slope(const State&);
  /// u2 of a set after a position was added.
  [[nodiscard]] static Eigen::VectorXd u2_with(const State&, const PositionInformation&);
  /// Figure of merit of a set: a power mean of the uncertainties. It is nearly the largest
  /// uncertainty, but also decreases with the others.
  [[nodiscard]] static double merit(const Eigen::VectorXd& u2);

 private:
  Eigen::MatrixXd of_parameters_;  ///< column j: derivative of parameter j by the shared unknowns
  Eigen::VectorXd prior_;
};

}  // namespace abbe::calib::mfb
