#pragma once
/// Checks of the steps per count of the devices that read the axes, and their text in messages.

#include <string>

#include "abbe/config/config.hpp"
#include "abbe/settings/section.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

/// Largest plausible step per count. Readings with larger steps cannot show errors of some um.
inline constexpr double kLargestStep_m = 1e-3;
inline constexpr double kLargestStep_rad = 0.1;

/// Adds a fault at step_nm or step_nrad if `step` per count is larger than that of any real scale;
/// no fault in a recorded configuration.
void check_step(ClassifiedSection& section, double step, bool linear);

/// Adds a fault for every axis whose step is possible but improbable. `table`.`list` is the array
/// in the file that has one element with a step per axis.
void doubt_steps(Section& root, const char* table, const char* list, const MachineConfig& machine);

/// The step as text: "10 nm".
[[nodiscard]] std::string step_text(double step, bool linear);

}  // namespace abbe::daemon
