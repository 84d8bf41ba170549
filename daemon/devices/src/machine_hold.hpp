#pragma once
/// State of a measuring machine that survives a restart of the daemon. DATA_DIR/machine-hold
/// contains the reason why the machine awaits a release, until the operator releases it, and a flag
/// while a motion is under way. If the daemon finds the flag at its start, or cannot read the file,
/// it stops the motion (AbortE) and awaits a release.

#include <filesystem>

#include "abbe/drivers/ippdme/device.hpp"

namespace abbe::daemon {

/// Sets session.held and session.moving from the file, and machine_changed to write it.
void keep_hold(const std::filesystem::path& data_dir, drivers::IppDeviceOptions& options);

}  // namespace abbe::daemon
