#pragma once
/// `abbed --check-config`: checks the configuration together with the files and folders that it
/// names on this computer, and reports how abbe understood it. abbed itself starts without a data
/// folder or a DDS profile and only reports this, because acquisition must not depend on them; here
/// a missing one is a fault.

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

struct CheckedConfig {
  Config config;
  /// Values that are possible but probably wrong, one text for each, "file:line:column: key: what".
  /// Examples are a value in another unit, a forgotten table, or the number of a CPU that this
  /// computer does not have.
  std::vector<std::string> warnings;
  /// Settings of name, travel, target and host that still have the value of the example file,
  /// "machine.name \"mill 7\"". Empty if fewer than two are left.
  std::vector<std::string> of_the_example;
};

/// Loads the file as load_config() does. Further faults are the path of a folder that cannot be
/// created, a missing DDS profile and a missing folder of DDS keys. `cpus`: number of CPUs of this
/// computer.
[[nodiscard]] Result<CheckedConfig> check_config(const std::filesystem::path& file, int cpus);

/// Describes the configuration, one line per fact, without line ends: machine, axes with travel and
/// nodes, target, devices with their addresses, folders, DDS.
[[nodiscard]] std::vector<std::string> summary_of(const Config& config);

}  // namespace abbe::daemon
