#pragma once
/// Direction of travel of each axis along a path, on which backlash depends.

#include <span>
#include <vector>

#include "abbe/calib/geometry/machine_state.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Direction of travel of each axis after a motion. An axis that moves by less than 1 um keeps its
/// direction.
[[nodiscard]] AxisTravel travel_after(AxisTravel before, const Vector3& motion_m);

/// Direction of travel of each axis along a path. OnTheFly: one entry for each leg. Standstill: one
/// entry for each vertex, the direction in which it is reached. An axis that rests on a leg keeps
/// its direction; Unknown before its first motion.
[[nodiscard]] std::vector<AxisTravel> travel_along(std::span<const Vector3> vertices_m, Mode);

}  // namespace abbe::calib::otf
