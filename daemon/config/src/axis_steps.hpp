#pragma once
/// Steps per count of the devices that read the axes.

#include <string>

#include "abbe/config/config.hpp"
#include "abbe/config/section.hpp"

namespace abbe::daemon {

/// Readings with steps this large cannot show errors of some um.
inline constexpr double kLargestStep_m = 1e-3;
inline constexpr double kLargestStep_rad = 0.1;

/// Adds a fault at step_nm or step_nrad if one count is larger than any scale has; none in a
/// recorded file.
void check_step(Section& section, double step, bool linear);

/// Adds a fault for every step that is possible but improbable. `table`.`list`: the axes of a
/// device, each with a step per count.
void doubt_steps(Section& root, const char* table, const char* list, const MachineConfig& machine);

/// "10 nm".
[[nodiscard]] std::string step_text(double step, bool linear);

}  // namespace abbe::daemon
