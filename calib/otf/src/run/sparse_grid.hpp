#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib::otf {

/// Grid of every n-th node of each axis, including both ends, with at most about `cells` cells per
/// axis.
inline std::vector<Vector3> sparse_grid(const MachineNodes& nodes, std::size_t cells) {
  MachineNodes few;
  for (const Axis a : kAllAxes) {
    const std::vector<double>& all = nodes[index(a)].nodes_m;
    const std::size_t step = std::max<std::size_t>(1, (all.size() - 1 + cells - 1) / cells);
    for (std::size_t i = 0; i + 1 < all.size(); i += step) {
      few[index(a)].nodes_m.push_back(all[i]);
    }
    few[index(a)].nodes_m.push_back(all.back());
  }
  return tensor_grid(few);
}

}  // namespace abbe::calib::otf
