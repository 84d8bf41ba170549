#pragma once
/// How deep a TOML text nests, before a parser sees it: parsers recurse, and so do the copies and
/// destructors of what they make. For everyone who reads TOML that others wrote: abbed, abbe and
/// abbe-sim, which include nothing of each other. Pure; allocates as much as the text nests; no
/// recursion.

#include <cstddef>
#include <optional>
#include <string_view>

namespace abbe::protocol {

struct TomlBounds {
  std::size_t bytes = 1u << 20;
  /// parts of keys and table names, nested arrays and inline tables, together
  std::size_t depth = 64;
};

/// The place of the first byte at which `text` nests deeper than `most`; nothing: it never does. Up
/// to the parser's first error it is never less than what the parser nests.
[[nodiscard]] std::optional<std::size_t> toml_deeper_than(std::string_view text, std::size_t most);

}  // namespace abbe::protocol
