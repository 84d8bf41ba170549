#pragma once
/// State of a measuring machine that survives a restart of the daemon. The file
/// DATA_DIR/machine-hold contains a flag while a motion is under way, and the reason why the
/// machine awaits a release by the operator. If the daemon finds the flag at its start, or cannot
/// read the file, it stops the motion (AbortE) and awaits a release.

#include <filesystem>
#include <string>

#include "abbe/drivers/ippdme/device.hpp"

namespace abbe::daemon {

/// The content of the file for this state.
[[nodiscard]] std::string hold_text(const drivers::IppMachine& machine);

/// Sets session.held and session.moving in `options` from the file, and machine_changed and
/// machine_stored to functions of a MachineHoldWriter for the file.
void keep_hold(const std::filesystem::path& data_dir, drivers::IppDeviceOptions& options);

}  // namespace abbe::daemon
