#pragma once
/// Touches for a measuring machine that moves to commanded positions, with the path of the tip to
/// each touch. Places are centres of the tip in machine axes, m.

#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

struct MachineTouch {
  std::vector<Vector3> way_m;         ///< corner points of the path to the touch
  Vector3 at_m = Vector3::Zero();     ///< centre of the tip in contact
  Vector3 normal = Vector3::UnitZ();  ///< normal of the surface, towards the tip
};

struct MachineTouches {
  std::vector<MachineTouch> touches;
  std::vector<Vector3> leave_m;  ///< path after the last touch: off the surface, then up
};

}  // namespace abbe::calib
