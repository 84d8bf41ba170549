#pragma once
/// The coefficient b that minimises (z - b)^2 / 2 + penalty, for all three penalties as one
/// piecewise linear function of |z|, so that scalar code and vector code compute the same bits. b
/// has the sign of z; |b| is
///     |z| <= lambda       0
///     |z| <= inner_end    |z| - lambda
///     |z| <= outer_end    (|z| - offset) * factor
///     else                |z|

#include <cmath>
#include <limits>

#include "abbe/calib/internal/sparse/penalty.hpp"

namespace abbe::calib::sparse {

struct Shrinkage {
  double lambda = 0.0;
  double inner_end = 0.0;
  double outer_end = 0.0;
  double offset = 0.0;
  double factor = 0.0;

  [[nodiscard]] double operator()(double z) const {
    const double size = std::abs(z);
    if (size <= lambda) return 0.0;
    if (size <= inner_end) return std::copysign(size - lambda, z);
    if (size <= outer_end) return std::copysign((size - offset) * factor, z);
    return z;
  }
};

[[nodiscard]] inline Shrinkage shrinkage(const Penalty& penalty, double lambda) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double gamma = penalty.gamma;
  switch (penalty.kind) {
    case PenaltyKind::Mcp:
      return {lambda, -1.0, gamma * lambda, lambda, 1 / (1 - 1 / gamma)};
    case PenaltyKind::Scad:
      return {lambda, lambda + lambda, gamma * lambda, gamma * lambda / (gamma - 1),
              1 / (1 - 1 / (gamma - 1))};
    case PenaltyKind::Lasso:
      break;
  }
  return {lambda, kInfinity, kInfinity, lambda, 1.0};
}

}  // namespace abbe::calib::sparse
