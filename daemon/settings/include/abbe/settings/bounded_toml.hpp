#pragma once
/// TOML with limits on size and nesting depth, checked before the text is parsed: parsed tables are
/// copied and destroyed recursively, so deep nesting could exhaust the stack. Each part of a dotted
/// key (a.b.c) adds one level.

#include <toml++/toml.h>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/protocol/toml_nesting.hpp"

namespace abbe::daemon {

using protocol::TomlBounds;

/// The parsed table, or BadInput with one fault, "FILE:LINE:COLUMN: ...". Only the first syntax
/// error is reported, because the faults after it would not be reliable.
[[nodiscard]] Result<toml::table> parse_toml(std::string_view text, const std::string& file,
                                             const TomlBounds& bounds = {});

/// A file that a person wrote has fewer faults than this; the limit shortens the list for a file
/// that is not a configuration at all.
inline constexpr std::size_t kMostConfigFaults = 1000;

/// Io if the file cannot be read.
[[nodiscard]] Result<std::string> read_configuration_text(const std::filesystem::path& file);

}  // namespace abbe::daemon
