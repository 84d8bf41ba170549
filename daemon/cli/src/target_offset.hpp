#pragma once
/// The target offset of one measurement, where an input file states it for this measurement.

#include "abbe/calib/geometry.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// Replaces [target] offset_mm: from the tool reference point to the reflector or stylus tip.
inline void set_target(MachineConfig& machine, const calib::Vector3& offset_m) {
  machine.target_offset_m = {offset_m.x(), offset_m.y(), offset_m.z()};
  machine.target_given = true;
}

}  // namespace abbe::daemon
