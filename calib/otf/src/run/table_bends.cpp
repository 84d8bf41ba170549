#include "abbe/calib/internal/otf/run/table_bends.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::calib::otf {
namespace {

/// Distance of nodes for which the size of the prior is stated, and factor of this size for
/// rotations in rad.
constexpr double kUnitDistance_m = 0.05, kRotationsInRad = 2.0;

TableBend bend_at(const Table& table, const std::vector<double>& nodes_m, std::size_t node) {
  const double left_m = nodes_m[node] - nodes_m[node - 1],
               right_m = nodes_m[node + 1] - nodes_m[node];
  const double h_m = 0.5 * (left_m + right_m), a = h_m / left_m, b = h_m / right_m;
  const std::size_t at = table.offset + node;
  const double relative = h_m / kUnitDistance_m;
  return {.motion = table.motion,
          .position_m = nodes_m[node],
          .from_m = nodes_m[node - 1],
          .to_m = nodes_m[node + 1],
          .row = {{{at - 1, a}, {at, -(a + b)}, {at + 1, b}}},
          .sigma_of_unit = relative * std::sqrt(relative) *
                           (is_rotation(table.motion.motion) ? kRotationsInRad : 1.0)};
}

}  // namespace

std::vector<TableBend> bends_of(const ParameterLayout& layout) {
  std::vector<TableBend> all;
  for (const Table& table : layout.tables()) {
    const std::vector<double>& nodes_m = layout.nodes()[index(table.motion.axis)].nodes_m;
    for (std::size_t node = 1; node + 1 < nodes_m.size(); ++node) {
      all.push_back(bend_at(table, nodes_m, node));
    }
  }
  return all;
}

BendCoordinates bend_coordinates(const std::vector<TableBend>& bends, Eigen::Index unknowns) {
  BendCoordinates c{Eigen::MatrixXd::Identity(unknowns, unknowns), {}};
  std::vector<bool> is_bend(static_cast<std::size_t>(unknowns), false);
  // U_i+1 = (bend - a U_i-1 + (a + b) U_i) / b, node by node: earlier rows of U_of are complete.
  for (const TableBend& bend : bends) {
    const auto& [before, middle, after] = bend.row;
    const auto row = static_cast<Eigen::Index>(after.column);
    is_bend[after.column] = true;
    c.U_of.row(row) =
        (c.U_of.row(row) - before.value * c.U_of.row(static_cast<Eigen::Index>(before.column)) -
         middle.value * c.U_of.row(static_cast<Eigen::Index>(middle.column)))
            .eval() /
        after.value;
  }
  for (std::size_t i = 0; i < is_bend.size(); ++i) {
    if (!is_bend[i]) {
      c.others.push_back(i);
    }
  }
  return c;
}

}  // namespace abbe::calib::otf
