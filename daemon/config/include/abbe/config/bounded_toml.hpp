#pragma once
/// TOML with bounds on size and depth, checked before the parser sees the text: its tables are
/// copied and destroyed recursively, and a dotted key nests as deep as it has parts.

#include <toml++/toml.h>
#include <cstddef>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/protocol/toml_nesting.hpp"

namespace abbe::daemon {

using protocol::TomlBounds;

/// Else BadInput with one fault, "FILE:LINE:COLUMN: ...": after a fault of syntax the parser only
/// guesses.
[[nodiscard]] Result<toml::table> parse_toml(std::string_view text, const std::string& file,
                                             const TomlBounds& bounds = {});

}  // namespace abbe::daemon
