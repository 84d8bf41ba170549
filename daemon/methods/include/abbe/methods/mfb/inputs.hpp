#pragma once
/// Input types of an identification with a Multi-Feature Bar from the configuration. Pure.

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/measurement.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// Chain, nodes and interpolation of the tables. [model] basis "cubic" is a cubic with not-a-knot
/// ends here. Errors of otf_machine().
[[nodiscard]] Result<calib::mfb::MfbMachine> mfb_machine(const MachineConfig& machine);

}  // namespace abbe::daemon
