#pragma once
/// Node positions of the error tables: all tables of one axis share the same nodes.

#include <array>
#include <vector>

#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/geometry/linear_interpolation.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// Range, nodes and reference of one linear axis.
struct AxisNodes {
  std::vector<double> nodes_m;  ///< strictly ascending, both ends of the range included
  /// positioning and rotation errors are zero at this position in datum G2 (model_datum.hpp); must
  /// be inside the range
  double reference_m = 0.0;
};

/// One entry each for X, Y, Z.
using MachineNodes = std::array<AxisNodes, 3>;
[[nodiscard]] inline Vector3 reference_position_m(const MachineNodes& nodes) {
  return {nodes[0].reference_m, nodes[1].reference_m, nodes[2].reference_m};
}

/// Nodes from min to max with equal steps of at most `spacing_m` (default 0.05 m: the spacing of
/// [Sanders 2023]). The reference is 0 if 0 is inside the range, else min. BadInput if min >= max
/// or if the spacing is not positive.
[[nodiscard]] Result<AxisNodes> equidistant_nodes(double min_m, double max_m,
                                                  double spacing_m = 0.05);

}  // namespace abbe::calib
