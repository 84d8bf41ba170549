#pragma once
/// Whole files in and out.

#include <string>
#include <string_view>

#include "abbe/sim/error.hpp"

namespace abbe::sim {

[[nodiscard]] Result<std::string> read_file(const std::string& path);
/// `path` seen from the folder that `file` is in, as paths in configurations are.
[[nodiscard]] std::string beside_file(const std::string& file, const std::string& path);
/// "-" is standard output. Written beside and renamed, so that nobody sees half a file.
[[nodiscard]] Result<void> write_file(const std::string& path, std::string_view text);

}  // namespace abbe::sim
