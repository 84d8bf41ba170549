#pragma once
/// Sets the target offset of one measurement, if an input file states it for this measurement.

#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// Replaces [target] offset_mm, the vector from the tool reference point to the reflector or stylus
/// tip.
inline void set_target(Config& config, const calib::Vector3& offset_m) {
  set_target_offset(config, {offset_m.x(), offset_m.y(), offset_m.z()});
}

}  // namespace abbe::daemon
