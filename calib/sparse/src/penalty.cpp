#include "abbe/calib/internal/sparse/penalty.hpp"

#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "shrinkage.hpp"

namespace abbe::calib::sparse {
namespace {

double smallest_gamma(PenaltyKind kind) {
  return kind == PenaltyKind::Scad ? 2.0 : 1.0;
}

}  // namespace

Result<void> check(const Penalty& penalty) {
  if (penalty.kind == PenaltyKind::Lasso) return {};
  if (!std::isfinite(penalty.gamma)) {
    return failure(ErrorCode::NotFinite,
                   message("gamma of ", name(penalty.kind), ": ", penalty.gamma));
  }
  const double limit = smallest_gamma(penalty.kind);
  if (penalty.gamma <= limit) {
    return failure(ErrorCode::BadInput,
                   message("gamma of ", name(penalty.kind), " must be greater than ", limit, ": ",
                           penalty.gamma));
  }
  return {};
}

double value(const Penalty& penalty, double lambda, double magnitude) {
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

double derivative(const Penalty& penalty, double lambda, double magnitude) {
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

double minimiser(const Penalty& penalty, double lambda, double z) {
  return shrinkage(penalty, lambda)(z);
}

double concavity(const Penalty& penalty) {
  switch (penalty.kind) {
    case PenaltyKind::Mcp:
      return 1 / penalty.gamma;
    case PenaltyKind::Scad:
      return 1 / (penalty.gamma - 1);
    case PenaltyKind::Lasso:
      break;
  }
  return 0.0;
}

}  // namespace abbe::calib::sparse
