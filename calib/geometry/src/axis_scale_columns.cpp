#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"

#include <cstddef>

namespace abbe::calib {

Eigen::MatrixX3d axis_scale_columns(const ParameterLayout& layout) {
  Eigen::MatrixX3d G = Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(layout.model_size()), 3);
  for (const Table& table : layout.tables()) {
    if (!is_positioning(table.motion)) {
      continue;
    }
    const AxisNodes& nodes = layout.nodes()[index(table.motion.axis)];
    for (std::size_t i = 0; i < nodes.nodes_m.size(); ++i) {
      G(static_cast<Eigen::Index>(table.offset + i),
        static_cast<Eigen::Index>(index(table.motion.axis))) = nodes.nodes_m[i] - nodes.reference_m;
    }
  }
  return G;
}

}  // namespace abbe::calib
