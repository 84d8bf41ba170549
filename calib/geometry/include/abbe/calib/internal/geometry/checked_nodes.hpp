#pragma once
/// Positions at which a model of cubic tables is checked.

#include "abbe/calib/geometry/axis_table.hpp"

namespace abbe::calib {

/// Positions at which a model of cubic tables is checked: the nodes and the middle of each cell,
/// because a cubic can have its largest values and slopes between nodes. If this makes a grid of
/// more than kMostChecked positions, the nodes alone.
[[nodiscard]] inline MachineNodes checked_nodes_of_cubic(const MachineNodes& nodes) {
  constexpr double kMostChecked = 3e5;  // V takes 0.5 us at each position
  MachineNodes with_middles = nodes;
  double positions = 1.0;
  for (AxisNodes& axis : with_middles) {
    const std::vector<double> all = std::move(axis.nodes_m);
    axis.nodes_m.clear();
    for (std::size_t i = 0; i + 1 < all.size(); ++i) {
      axis.nodes_m.push_back(all[i]);
      axis.nodes_m.push_back(0.5 * (all[i] + all[i + 1]));
    }
    axis.nodes_m.push_back(all.back());
    positions *= static_cast<double>(axis.nodes_m.size());
  }
  return positions <= kMostChecked ? with_middles : nodes;
}

}  // namespace abbe::calib
