#pragma once
/// Requirement on the scale of a model of tables, common to one run and several parts.

#include <cmath>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib {

/// Relative length error of V that is common to all directions: s of V = s p + rigid motion.
inline double common_scale_error(const VolumetricModel& model) {
  const std::vector<Vector3> at = tensor_grid(model.nodes());
  std::vector<Vector3> V_m;
  for (const Vector3& q : at) {
    V_m.push_back(model.V_at(q, model.tool_offsets_m().front()));
  }
  return common_scale(at, V_m);
}

/// Refuses the model if |scale| > `most`, or if the scale is NaN.
inline void require_plausible_scale(Verdict& verdict, double scale, double most) {
  if (!(std::abs(scale) <= most)) {
    verdict.refuse(
        "growth",
        message("the machine is larger by ", 1e6 * scale, " um/m in all directions, limit ",
                1e6 * most, " um/m: wrong scale of the path, of the ranges or of a temperature"));
  }
}

}  // namespace abbe::calib
