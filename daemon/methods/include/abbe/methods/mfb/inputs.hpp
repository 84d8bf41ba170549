#pragma once
/// Makes the input types of an identification with a Multi-Feature Bar from the configuration.
/// Pure.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// Chain, nodes and interpolation of the tables. Here [model] basis "cubic" means a cubic spline
/// with not-a-knot ends. The errors are those of otf_machine().
[[nodiscard]] Result<calib::mfb::MfbMachine> mfb_machine(const MachineConfig& machine);

/// Notes for the verdict about what the inputs do not determine: passes in one direction only, a
/// bar without thermal expansion or uncertainty, tables that are linear between their nodes. One
/// sentence each.
[[nodiscard]] std::vector<std::string> notes_on_inputs(const calib::mfb::Bar& bar,
                                                       const calib::mfb::Plan& plan,
                                                       const MachineConfig& machine);

}  // namespace abbe::daemon
