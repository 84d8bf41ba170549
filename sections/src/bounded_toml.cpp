#include "abbe/sections/bounded_toml.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "abbe/protocol/table/faults.hpp"
#include "toml_nesting.hpp"

namespace abbe::sections {
namespace {

tl::unexpected<NotToml> fault_at(const std::string& file, std::size_t line, std::size_t column,
                                 std::string_view what) {
  protocol::Faults faults(file);
  faults.add(line, column, "", what);
  return tl::make_unexpected(NotToml{faults.heading(), faults.lines()});
}

tl::unexpected<NotToml> too_deep(std::string_view text, std::size_t at, const std::string& file,
                                 std::size_t most) {
  const std::string_view before = text.substr(0, at);
  const auto line = 1 + static_cast<std::size_t>(std::ranges::count(before, '\n'));
  const std::size_t line_begin = before.rfind('\n') + 1;  // npos + 1 is 0
  return fault_at(file, line, at - line_begin + 1, fmt::format("nested deeper than {}", most));
}

}  // namespace

tl::expected<toml::table, NotToml> parse_bounded(std::string_view text, const std::string& file,
                                                 const TomlBounds& bounds) {
  if (text.size() > bounds.bytes)
    return tl::make_unexpected(
        NotToml{fmt::format("{}: {} bytes, at most {} are read", file, text.size(), bounds.bytes)});
  if (const auto at = toml_deeper_than(text, bounds.depth))
    return too_deep(text, *at, file, bounds.depth);
  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error& error) {
    const auto at = error.source().begin;
    return fault_at(file, at.line, at.column, error.description());
  }
}

}  // namespace abbe::sections
