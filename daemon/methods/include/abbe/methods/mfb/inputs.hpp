#pragma once
/// Input types of an identification with a Multi-Feature Bar from the configuration. Pure.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// Chain, nodes and interpolation of the tables. [model] basis "cubic" is a cubic with not-a-knot
/// ends here. Errors of otf_machine().
[[nodiscard]] Result<calib::mfb::MfbMachine> mfb_machine(const MachineConfig& machine);

/// What the inputs leave open, for the verdict: passes without a way back, a bar without expansion
/// or uncertainty, tables that are linear between their nodes. One sentence each.
[[nodiscard]] std::vector<std::string> notes_on_inputs(const calib::mfb::Bar& bar,
                                                       const calib::mfb::Plan& plan,
                                                       const MachineConfig& machine);

}  // namespace abbe::daemon
