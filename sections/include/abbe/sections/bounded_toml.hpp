#pragma once
/// TOML with limits on size and nesting depth, checked before the text is parsed: the parser
/// recurses, and so do the copy constructor and destructor of its result, so deep nesting could
/// exhaust the stack.

#include <toml++/toml.h>
#include <cstddef>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

namespace abbe::sections {

struct TomlBounds {
  std::size_t bytes = 1u << 20;
  /// largest nesting depth: parts of keys and table names, nested arrays and inline tables, summed
  std::size_t depth = 64;
};

/// Why a text was refused: a heading, and below it the fault with its place.
struct NotToml {
  std::string text;
  std::vector<std::string> details = {};
};

/// The parsed table, or one fault, "FILE:LINE:COLUMN: ...". Only the first syntax error is
/// reported, because the faults after it would not be reliable.
[[nodiscard]] tl::expected<toml::table, NotToml> parse_bounded(std::string_view text,
                                                               const std::string& file,
                                                               const TomlBounds& bounds = {});

}  // namespace abbe::sections
