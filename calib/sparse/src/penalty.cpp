#include "abbe/calib/internal/sparse/penalty.hpp"

#include <cmath>

#include "abbe/calib/internal/base/message.hpp"

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
