#pragma once
/// Penalties of sparse regression for a single coefficient, with columns of unit mean square and
/// the objective
///   1/(2n) |y - X b|^2 + sum_j p(|b_j|).
/// Lasso [Tibshirani 1996], MCP [Zhang 2010], SCAD [Fan 2001]. Unit-free: lambda has the unit of b,
/// which is that of y.

#include <string_view>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib::sparse {

enum class PenaltyKind { Lasso, Mcp, Scad };
[[nodiscard]] constexpr std::string_view name(PenaltyKind kind) {
  switch (kind) {
    case PenaltyKind::Lasso:
      return "lasso";
    case PenaltyKind::Mcp:
      return "MCP";
    case PenaltyKind::Scad:
      return "SCAD";
  }
  return "?";
}

/// A penalty with its parameter gamma: the larger gamma, the larger the coefficients that are still
/// penalised. gamma > 2 for SCAD, > 1 for MCP, not used by the lasso.
struct Penalty {
  PenaltyKind kind = PenaltyKind::Scad;
  double gamma = 3.7;  ///< 3.7: the value [Fan 2001] recommends for SCAD; 3 is customary for MCP
};

/// Returns BadInput if gamma is too small for the kind, NotFinite if it is NaN or infinite.
[[nodiscard]] Result<void> check(const Penalty&);

/// Largest downward curvature of p: 1/gamma for MCP, 1/(gamma - 1) for SCAD, 0 for the lasso.
[[nodiscard]] double concavity(const Penalty&);

}  // namespace abbe::calib::sparse
