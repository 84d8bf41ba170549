#pragma once
/// Uncertainties of many sets of positions, for the choice among them. The normal matrix is formed,
/// which loses digits; the result of the choice is computed by PlanPredictor.

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
    Eigen::VectorXd u2;  ///< of each parameter of the model, relative to its squared limit
  };
  [[nodiscard]] State state_of(const Eigen::MatrixXd& information) const;

  /// Derivative of the sum in merit() by the information: minus trace(A G A^T) for rows A.
  [[nodiscard]] static Eigen::MatrixXd slope(const State&);
  /// u2 of a set after a position was added.
  [[nodiscard]] static Eigen::VectorXd u2_with(const State&, const PositionInformation&);
  /// A power mean of the uncertainties: nearly the largest one, but it falls with others, too.
  [[nodiscard]] static double merit(const Eigen::VectorXd& u2);

 private:
  Eigen::MatrixXd of_parameters_;  ///< column: a parameter by the shared unknowns
  Eigen::VectorXd prior_;
};

}  // namespace abbe::calib::mfb
