#pragma once
/// Checks the nesting depth of a TOML text before it is parsed. Pure; allocates in proportion to
/// the depth; no recursion.

#include <cstddef>
#include <optional>
#include <string_view>

namespace abbe::sections {

/// Offset of the first byte at which `text` nests deeper than `most`; nullopt if it does not. Up to
/// the parser's first error, the depth counted here is never below that of the parser.
[[nodiscard]] std::optional<std::size_t> toml_deeper_than(std::string_view text, std::size_t most);

}  // namespace abbe::sections
