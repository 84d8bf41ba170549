#pragma once
/// Parses TOML with the limits defined in sections; faults are errors of the daemon.

#include <toml++/toml.h>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/sections/bounded_toml.hpp"

namespace abbe::daemon {

using sections::TomlBounds;

/// The parsed table, or BadInput with one fault, "FILE:LINE:COLUMN: ...".
[[nodiscard]] Result<toml::table> parse_toml(std::string_view text, const std::string& file,
                                             const TomlBounds& bounds = {});

/// A file that a person has written has fewer faults than this. The limit shortens the list for a
/// file that is not a configuration at all.
inline constexpr std::size_t kMostConfigFaults = 1000;

/// The text of the file. Io if it cannot be read.
[[nodiscard]] Result<std::string> read_configuration_text(const std::filesystem::path& file);

}  // namespace abbe::daemon
