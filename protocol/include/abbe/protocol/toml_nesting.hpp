#pragma once
/// Checks the nesting depth of a TOML text before it is parsed. The parser recurses, and so do the
/// copy constructor and destructor of its result, so deep nesting would overflow the stack. Used by
/// abbed, abbe and abbe-sim, which do not include each other. Pure; allocates in proportion to the
/// depth; no recursion.

#include <cstddef>
#include <optional>
#include <string_view>

namespace abbe::protocol {

struct TomlBounds {
  std::size_t bytes = 1u << 20;
  /// largest nesting depth: parts of keys and table names, nested arrays and inline tables, summed
  std::size_t depth = 64;
};

/// Offset of the first byte at which `text` nests deeper than `most`; nullopt if it does not. Up to
/// the parser's first error, the depth counted here is never below that of the parser.
[[nodiscard]] std::optional<std::size_t> toml_deeper_than(std::string_view text, std::size_t most);

}  // namespace abbe::protocol
