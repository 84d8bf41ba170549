#include "abbe/calib/geometry/axis_table.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib {

Result<void> check_nodes(std::span<const double> nodes_m) {
  if (nodes_m.size() < 2) {
    return failure(ErrorCode::BadInput,
                   message("nodes of an axis: ", nodes_m.size(), ", needs at least 2"));
  }

  for (std::size_t i = 0; i < nodes_m.size(); ++i) {
    if (!std::isfinite(nodes_m[i])) {
      return failure(ErrorCode::NotFinite,
                     message("nodes of an axis: node ", i, " is not a number"));
    }
    if (i > 0 && !(nodes_m[i] > nodes_m[i - 1])) {
      return failure(ErrorCode::BadInput, message("nodes of an axis: ", nodes_m[i], " m after ",
                                                  nodes_m[i - 1], " m, must ascend"));
    }
  }

  return {};
}

BasisRow basis_row(std::span<const double> nodes_m, double position_m) {
  const auto above = std::upper_bound(nodes_m.begin(), nodes_m.end(), position_m);
  const auto right =
      std::clamp<std::ptrdiff_t>(above - nodes_m.begin(), 1, std::ssize(nodes_m) - 1);
  const std::size_t k = static_cast<std::size_t>(right) - 1;
  const double u = (position_m - nodes_m[k]) / (nodes_m[k + 1] - nodes_m[k]);
  return {k, {1.0 - u, u}};
}

Result<AxisNodes> equidistant_nodes(double min_m, double max_m, double spacing_m) {
  if (!(min_m < max_m) || !(spacing_m > 0) || !std::isfinite(max_m - min_m)) {
    return failure(ErrorCode::BadInput,
                   message("nodes from ", min_m, " to ", max_m, " m, spacing ", spacing_m,
                           " m: needs min < max and a positive spacing"));
  }

  // The number of cells is rounded up to an integer. 1e-9 is subtracted so that rounding errors do
  // not add a cell if the range is a multiple of the spacing.
  const double cells = std::max(1.0, std::ceil((max_m - min_m) / spacing_m - 1e-9));
  constexpr double kMostCells = 1e5;
  if (cells > kMostCells) {
    return failure(ErrorCode::BadInput,
                   message("nodes from ", min_m, " to ", max_m, " m every ", spacing_m,
                           " m: ", cells, " cells, at most ", kMostCells, " are allowed"));
  }

  AxisNodes axis;
  const auto n = static_cast<std::size_t>(cells);
  for (std::size_t i = 0; i <= n; ++i) {
    axis.nodes_m.push_back(i == n ? max_m
                                  : min_m + (max_m - min_m) * static_cast<double>(i) / cells);
  }

  axis.reference_m = (min_m <= 0 && 0 <= max_m) ? 0.0 : min_m;
  return axis;
}

}  // namespace abbe::calib
