#pragma once
/// Linear interpolation of an error table between its nodes. The other interpolations
/// (geometry/axis_interpolation.hpp) also reproduce constants and straight lines exactly, because
/// the datum conditions (model_datum.hpp) rely on this property.

#include <cstddef>
#include <span>
#include <string_view>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib {

// Names of the interpolations of tables in configurations, files and messages.
inline constexpr std::string_view kLinearBasis = "linear";
inline constexpr std::string_view kCubicBasis = "cubic";  ///< natural cubic spline
inline constexpr std::string_view kNotAKnotCubicBasis = "not-a-knot-cubic";

/// Value f of a table at position q, U: values of the table at its nodes,
///     f(q) = weight[0] U[first] + weight[1] U[first + 1].
struct BasisRow {
  std::size_t first = 0;
  double weight[2] = {1.0, 0.0};
};

/// Outside the range of the nodes, the formula of the nearest cell is extrapolated. `nodes_m` must
/// be ascending, at least 2.
[[nodiscard]] BasisRow basis_row(std::span<const double> nodes_m, double position_m);

/// Returns BadInput or NotFinite unless there are at least 2 nodes, all finite and strictly
/// ascending.
[[nodiscard]] Result<void> check_nodes(std::span<const double> nodes_m);

}  // namespace abbe::calib
