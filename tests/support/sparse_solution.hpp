#pragma once
/// Solutions of penalised least squares, checked independently of the solver: the objective
///     1/(2n) |y - X b|^2 + sum_j p(|b_j|)
/// of the standardised problem with n rows and penalty p (penalty.hpp), the conditions of a
/// stationary point, and the solution for one coefficient.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/sparse/path.hpp"
#include "abbe/calib/internal/sparse/standardise.hpp"

namespace abbe::tests::sparse {

using calib::sparse::Penalty;
using calib::sparse::PenaltyKind;

/// p(t), t: magnitude of a coefficient.
inline double value(const Penalty& penalty, double lambda, double magnitude) {
  const double t = magnitude, l = lambda, g = penalty.gamma;
  switch (penalty.kind) {
    case PenaltyKind::Mcp:
      return t <= g * l ? l * t - t * t / (2 * g) : g * l * l / 2;
    case PenaltyKind::Scad:
      if (t <= l) return l * t;
      return t <= g * l ? (2 * g * l * t - t * t - l * l) / (2 * (g - 1)) : l * l * (g + 1) / 2;
    case PenaltyKind::Lasso:
      break;
  }
  return l * t;
}

/// p'(t)
inline double derivative(const Penalty& penalty, double lambda, double magnitude) {
  const double t = magnitude, l = lambda, g = penalty.gamma;
  switch (penalty.kind) {
    case PenaltyKind::Mcp:
      return t <= g * l ? l - t / g : 0.0;
    case PenaltyKind::Scad:
      if (t <= l) return l;
      return t <= g * l ? (g * l - t) / (g - 1) : 0.0;
    case PenaltyKind::Lasso:
      break;
  }
  return l;
}

/// The coefficient b that minimises (z - b)^2 / 2 + p(|b|), as printed in [Tibshirani 1996],
/// [Zhang 2010] and [Fan 2001].
inline double minimiser(const Penalty& penalty, double lambda, double z) {
  const double size = std::abs(z), l = lambda, g = penalty.gamma;
  const double soft = std::max(size - l, 0.0);
  double b = soft;
  if (penalty.kind == PenaltyKind::Mcp) b = size <= g * l ? soft / (1 - 1 / g) : size;
  if (penalty.kind == PenaltyKind::Scad && size > 2 * l)
    b = size <= g * l ? ((g - 1) * size - g * l) / (g - 2) : size;
  return std::copysign(b, z);
}

/// Predictions for the rows of X, intercept included, from the solution at lambda[k].
inline Eigen::VectorXd predict(const calib::sparse::Path& path, const Eigen::MatrixXd& X,
                               Eigen::Index k) {
  const auto beta = path.coefficients.col(k);
  return (X * beta.tail(X.cols())).array() + beta(0);
}

/// Standardised columns, their coefficients, and what they leave of the centred y. `b` has one
/// coefficient for each column of X, as Path::standardised.
struct Standing {
  Eigen::MatrixXd Z;
  Eigen::VectorXd b, residual;

  Standing(const Eigen::MatrixXd& X, const Eigen::VectorXd& y, const Eigen::VectorXd& b_of_all) {
    const calib::sparse::Standardised design = calib::sparse::standardise(X).value();
    Z = design.X;
    b = b_of_all(design.kept);
    residual = y.array() - y.mean();
    residual -= Z * b;
  }
};

inline double objective(const Eigen::MatrixXd& X, const Eigen::VectorXd& y, const Penalty& penalty,
                        double lambda, const Eigen::VectorXd& b) {
  const Standing s(X, y, b);
  double sum = s.residual.squaredNorm() / (2 * static_cast<double>(y.size()));
  for (const double b_j : s.b) {
    sum += value(penalty, lambda, std::abs(b_j));
  }
  return sum;
}

/// Largest violation, in units of y, of the conditions that a stationary point b of the
/// standardised problem satisfies. With column z_j, n rows and g_j = z_j' (y - Z b) / n they are
///     |g_j| <= lambda                where b_j = 0,
///     g_j = sgn(b_j) p'(|b_j|)       elsewhere.
/// 0 to rounding at a stationary point; for a fitted path it is of the order of the tolerance times
/// the condition number.
inline double kkt_violation(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                            const Penalty& penalty, double lambda, const Eigen::VectorXd& b) {
  const Standing s(X, y, b);
  const Eigen::VectorXd g = s.Z.transpose() * s.residual / static_cast<double>(y.size());
  double worst = 0.0;
  for (Eigen::Index j = 0; j < g.size(); ++j) {
    const double slope = std::copysign(derivative(penalty, lambda, std::abs(s.b(j))), s.b(j));
    worst = std::max(worst, s.b(j) == 0 ? std::abs(g(j)) - lambda : std::abs(g(j) - slope));
  }
  return worst;
}

}  // namespace abbe::tests::sparse
