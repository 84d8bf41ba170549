#pragma once
/// The state of a machine on which its error may depend.

#include <array>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

/// Direction in which an axis last moved. It keeps its value while the axis rests; Unknown before
/// the first motion.
enum class Travel : signed char { Backward = -1, Unknown = 0, Forward = 1 };
using AxisTravel = std::array<Travel, 3>;  ///< directions of X, Y, Z

struct MachineState {
  Vector3 q_m = Vector3::Zero();            ///< scale readings of X, Y, Z
  Vector3 tool_offset_m = Vector3::Zero();  ///< from the tool reference point to the functional
                                            ///< point
  AxisTravel travel{};
  double time_s = 0.0;  ///< time since the begin of the run
  /// temperatures of the scales of X, Y, Z; 20 degC is the reference temperature of lengths
  std::array<double, 3> scale_temperature_K{293.15, 293.15, 293.15};
};

}  // namespace abbe::calib
