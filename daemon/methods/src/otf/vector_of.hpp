#pragma once

#include "abbe/base/axis_position.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::daemon {

[[nodiscard]] inline calib::Vector3 vector_of(const AxisPosition& q_m) {
  return {q_m[0], q_m[1], q_m[2]};
}

}  // namespace abbe::daemon
