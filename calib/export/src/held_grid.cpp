#include <algorithm>

#include "abbe/calib/export/held_correction.hpp"
#include "abbe/result/try.hpp"
#include "motion_fit.hpp"

namespace abbe::calib {

Vector3 HeldGrid::c_m(const Vector3& p_m) const {
  std::array<std::size_t, 3> cell{};
  Vector3 w;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto k = static_cast<Eigen::Index>(a);
    cell[a] = cell_of(axes_m[a], p_m[k]);
    const double first = axes_m[a][cell[a]], last = axes_m[a][cell[a] + 1];
    w[k] = std::clamp((p_m[k] - first) / (last - first), 0.0, 1.0);
  }

  Vector3 c = Vector3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    std::size_t at = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t upper = (corner >> a) & 1U;
      const double w_a = w[static_cast<Eigen::Index>(a)];
      weight *= upper != 0 ? w_a : 1.0 - w_a;
      at = at * axes_m[a].size() + cell[a] + upper;
    }
    c += weight * c_node_m[at];
  }
  return c;
}

Result<HeldGrid> grid_of_model(const VolumetricModel& model, const Vector3& tool_m,
                               const GridAxes& nodes_m, const AxisTravel& travel) {
  HeldGrid grid{nodes_m, {}, {}};
  for (const double x : nodes_m[0]) {
    for (const double y : nodes_m[1]) {
      for (const double z : nodes_m[2]) {
        const Vector3 p(x, y, z);
        const auto c = model.command_correction(p, tool_m, travel);
        ABBE_TRY(c);
        grid.c_node_m.push_back(c->c_m);
        grid.inside.push_back(model.validity().contains(p));
      }
    }
  }
  return grid;
}

}  // namespace abbe::calib
