#pragma once
/// `abbed --check-config`: the configuration together with what it refers to on this computer, and
/// what abbe understood of it. abbed itself starts without a data folder or a DDS profile and
/// reports them, because acquisition comes first; here they are faults.

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

struct CheckedConfig {
  Config config;
  /// Possible but improbable, "file:line:column: key: what": another unit, a forgotten table, or a
  /// CPU that another computer has.
  std::vector<std::string> warnings;
};

/// As load_config(); further faults are a folder that cannot exist, and a missing DDS profile or
/// folder of keys. `cpus`: number of CPUs of this computer.
[[nodiscard]] Result<CheckedConfig> check_config(const std::filesystem::path& file, int cpus);

/// One line per fact, without a line end: machine, axes with travel and nodes, target, devices with
/// their addresses, folders, DDS.
[[nodiscard]] std::vector<std::string> summary_of(const Config& config);

}  // namespace abbe::daemon
