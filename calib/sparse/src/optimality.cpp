#include "abbe/calib/internal/sparse/optimality.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "gram.hpp"

namespace abbe::calib::sparse {
namespace {

struct Fitted {
  GramProblem problem;
  Eigen::VectorXd b;  ///< of the kept columns
  Eigen::VectorXd residual;
};

Result<Fitted> fitted(const Eigen::MatrixXd& X, const Eigen::VectorXd& y, const Penalty& penalty,
                      const Eigen::VectorXd& b) {
  ABBE_TRY(check(penalty));
  if (b.size() != X.cols()) {
    return failure(ErrorCode::BadInput, message("check of a solution: ", b.size(),
                                                " coefficients for ", X.cols(), " columns"));
  }
  return gram_problem(X, y).map([&](GramProblem problem) {
    const Eigen::VectorXd kept = b(problem.design.kept);
    const Eigen::VectorXd residual = problem.y - problem.design.X * kept;
    return Fitted{std::move(problem), kept, residual};
  });
}

using Support = std::vector<Eigen::Index>;

Support union_support(const Eigen::MatrixXd& b, Eigen::Index k, const Support& kept) {
  const Eigen::Index next = std::min(k + 1, b.cols() - 1);
  Support support;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (b(kept[i], k) != 0 || b(kept[i], next) != 0)
      support.push_back(static_cast<Eigen::Index>(i));
  }
  return support;
}

double smallest_eigenvalue(const Eigen::MatrixXd& Z, const Support& support) {
  if (support.empty()) return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd Z_support = Z(Eigen::all, support);
  const Eigen::MatrixXd gram = Z_support.transpose() * Z_support / static_cast<double>(Z.rows());
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram, Eigen::EigenvaluesOnly)
      .eigenvalues()(0);
}

}  // namespace

Result<double> kkt_violation(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                             const Penalty& penalty, double lambda, const Eigen::VectorXd& b) {
  return fitted(X, y, penalty, b).map([&](const Fitted& fit) {
    const Eigen::VectorXd g =
        fit.problem.design.X.transpose() * fit.residual / static_cast<double>(y.size());
    double worst = 0.0;
    for (Eigen::Index j = 0; j < g.size(); ++j) {
      const double slope = std::copysign(derivative(penalty, lambda, std::abs(fit.b(j))), fit.b(j));
      const double violation = fit.b(j) == 0 ? std::abs(g(j)) - lambda : std::abs(g(j) - slope);
      worst = std::max(worst, violation);
    }
    return worst;
  });
}

Result<double> objective(const Eigen::MatrixXd& X, const Eigen::VectorXd& y, const Penalty& penalty,
                         double lambda, const Eigen::VectorXd& b) {
  return fitted(X, y, penalty, b).map([&](const Fitted& fit) {
    double sum = fit.residual.squaredNorm() / (2 * static_cast<double>(y.size()));
    for (const double b_j : fit.b) {
      sum += value(penalty, lambda, std::abs(b_j));
    }
    return sum;
  });
}

Result<Convexity> convexity(const Eigen::MatrixXd& X, const Path& path) {
  if (X.cols() != path.standardised.rows()) {
    return failure(ErrorCode::BadInput, message("convexity: the design has ", X.cols(),
                                                " columns, the path ", path.standardised.rows()));
  }

  return standardise(X).map([&](const Standardised& design) {
    Convexity out{Eigen::VectorXd(path.reached()), {}};
    Support before;
    double eigenvalue = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < path.reached(); ++k) {
      Support support = union_support(path.standardised, k, design.kept);
      if (support != before) eigenvalue = smallest_eigenvalue(design.X, support);
      before = std::move(support);
      out.smallest_eigenvalue(k) = eigenvalue - concavity(path.penalty);
      if (out.smallest_eigenvalue(k) < 0 && !out.first_nonconvex) out.first_nonconvex = k;
    }
    return out;
  });
}

}  // namespace abbe::calib::sparse
