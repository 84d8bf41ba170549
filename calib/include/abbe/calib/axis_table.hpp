#pragma once
/// Where the tables of a machine have their nodes: all tables of one axis share them.

#include <array>
#include <vector>

#include "abbe/calib/basis.hpp"
#include "abbe/calib/error_parameters.hpp"

namespace abbe::calib {

/// Range, nodes and reference of one linear axis.
struct AxisNodes {
  std::vector<double> nodes_m;  ///< strictly ascending, both ends of the range included
  /// positioning and rotations are zero here (gauge G1); inside the range
  double reference_m = 0.0;
};

/// Per axis X, Y, Z.
using MachineNodes = std::array<AxisNodes, 3>;

/// Nodes from min to max with equal steps of at most `spacing_m` (0.05 m: the spacing
/// [Sanders 2023] uses). Reference: 0 if that is inside the range, else min. BadInput if min >= max
/// or the spacing is not positive.
[[nodiscard]] Result<AxisNodes> equidistant_nodes(double min_m, double max_m,
                                                  double spacing_m = 0.05);

}  // namespace abbe::calib
