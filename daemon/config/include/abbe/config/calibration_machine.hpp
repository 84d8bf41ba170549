#pragma once
/// The configured machine as the input type of the mathematics. Pure.

#include "abbe/base/error.hpp"
#include "abbe/calib/otf/run.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// BadInput if the chain or the nodes are not those of a machine of three linear axes.
[[nodiscard]] Result<calib::otf::Machine> otf_machine(const MachineConfig& machine);

/// BadInput where [target] offset_mm is missing: every calibration needs it, and zeros would pass
/// for it.
[[nodiscard]] Result<void> require_target(const MachineConfig& machine);

}  // namespace abbe::daemon
