#pragma once
/// What a restart of the daemon must not forget of a measuring machine: DATA_DIR/machine-hold keeps
/// the reason for which it awaits a release until a person releases it, and that a motion is under
/// way until it has ended. A start that finds a motion stops it (AbortE) and awaits a release; so
/// does one that cannot read the file.

#include <filesystem>

#include "abbe/drivers/ippdme/device.hpp"

namespace abbe::daemon {

/// Sets session.held, session.moving and machine_changed.
void keep_hold(const std::filesystem::path& data_dir, drivers::IppDeviceOptions& options);

}  // namespace abbe::daemon
