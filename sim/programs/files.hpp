#pragma once
/// Reads and writes whole files.

#include <string>
#include <string_view>

#include "abbe/sim/error.hpp"

namespace abbe::sim {

[[nodiscard]] Result<std::string> read_file(const std::string& path);
/// The path that `path` in the configuration file `file` means: relative to the folder of that
/// file.
[[nodiscard]] std::string beside_file(const std::string& file, const std::string& path);
/// Writes PATH.part and renames it, so that no reader sees a partial file. "-" is standard output.
[[nodiscard]] Result<void> write_file(const std::string& path, std::string_view text);

}  // namespace abbe::sim
