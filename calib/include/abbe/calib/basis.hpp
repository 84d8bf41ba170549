#pragma once
/// How a table is read between its nodes. Linear now; another basis (natural cubic) is a further
/// enumerator here and a further case in basis_row(): every basis must contain constants and
/// straight lines exactly, the gauge relies on it.

#include <cstddef>
#include <span>
#include <string_view>

#include "abbe/calib/error.hpp"

namespace abbe::calib {

enum class Basis { Linear };
[[nodiscard]] constexpr std::string_view name(Basis) {
  return "linear";
}

/// f(q) = weight[0] U[first] + weight[1] U[first + 1].
struct BasisRow {
  std::size_t first = 0;
  double weight[2] = {1.0, 0.0};
};

/// Outside the range of the nodes the last cell's formula goes on. `nodes_m` ascending, at least 2.
[[nodiscard]] BasisRow basis_row(std::span<const double> nodes_m, double position_m);

/// BadInput or NotFinite unless there are at least 2 nodes, all finite and strictly ascending.
[[nodiscard]] Result<void> check_nodes(std::span<const double> nodes_m);

}  // namespace abbe::calib
