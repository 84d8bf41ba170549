#pragma once
/// Converts the configured machine to the input type of calib. Pure.

#include "abbe/base/error.hpp"
#include "abbe/calib/otf/run.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// The input of calib. BadInput if the chain or the nodes do not describe a machine with three
/// linear axes.
[[nodiscard]] Result<calib::otf::Machine> otf_machine(const MachineConfig& machine);

/// BadInput if [target] offset_mm (tool reference point to reflector) is missing. Every calibration
/// needs this offset; without this check the default zeros would be used.
[[nodiscard]] Result<void> require_target(const MachineConfig& machine);

}  // namespace abbe::daemon
