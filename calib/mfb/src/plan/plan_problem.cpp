#include "plan/plan_problem.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace abbe::calib::mfb {
namespace {

/// Prior uncertainty [m, rad], far above the limits, of an error that no position determines.
constexpr double kUnknown = 1e-2;
constexpr double kPower = 3.0;

/// 1 / limit of the uncertainty of each parameter.
Eigen::VectorXd inverse_limits(const ParameterLayout& layout, const SolveOptions& options) {
  Eigen::VectorXd inverse = Eigen::VectorXd::Constant(
      static_cast<Eigen::Index>(layout.model_size()), 1.0 / options.most_u_rad);
  for (const Table& table : layout.tables()) {
    if (!is_rotation(table.motion.motion)) {
      inverse
          .segment(static_cast<Eigen::Index>(table.offset),
                   static_cast<Eigen::Index>(layout.node_count(table.motion.axis)))
          .setConstant(1.0 / options.most_u_m);
    }
  }
  return inverse;
}

}  // namespace

SetProblem::SetProblem(const Observations& o, const SolveOptions& options) {
  const SharedUnknowns shared(o);
  const Eigen::Index free = shared.parameters(), n = shared.size();
  of_parameters_ = Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(o.basis.size()));
  of_parameters_.topRows(free) =
      shared.expanded(Eigen::MatrixXd::Identity(free, free)).transpose() *
      inverse_limits(o.basis.layout(), options).asDiagonal();
  prior_ = Eigen::VectorXd::Ones(n);
  prior_.head(free).setConstant(1.0 / (kUnknown * kUnknown));
}

Eigen::MatrixXd SetProblem::information(std::span<const PositionInformation* const> set) const {
  Eigen::MatrixXd H = prior_.asDiagonal();
  for (const PositionInformation* position : set) {
    H.noalias() += position->rows.transpose() * position->rows;
  }
  return H;
}

SetProblem::State SetProblem::state_of(const Eigen::MatrixXd& information) const {
  State s;
  s.C = information.llt().solve(Eigen::MatrixXd::Identity(information.rows(), information.cols()));
  s.B = s.C * of_parameters_;
  s.u2 = s.B.cwiseProduct(of_parameters_).colwise().sum().transpose();
  return s;
}

double SetProblem::merit(const Eigen::VectorXd& u2) {
  return std::pow(u2.array().max(0.0).pow(kPower).mean(), 0.5 / kPower);
}

Eigen::MatrixXd SetProblem::slope(const State& s) {
  const Eigen::VectorXd weight = (s.u2 / s.u2.maxCoeff()).array().max(0.0).pow(kPower - 1.0);
  return s.B * weight.asDiagonal() * s.B.transpose();
}

Eigen::VectorXd SetProblem::u2_with(const State& s, const PositionInformation& position) {
  // With A C A^T + I = L L^T, the rows A decrease the covariance by (L^-1 A C)^T (L^-1 A C).
  Eigen::MatrixXd S = position.rows * s.C * position.rows.transpose();
  S.diagonal().array() += 1.0;
  Eigen::MatrixXd Y = position.rows * s.B;
  S.llt().matrixL().solveInPlace(Y);
  return s.u2 - Y.colwise().squaredNorm().transpose();
}

}  // namespace abbe::calib::mfb
