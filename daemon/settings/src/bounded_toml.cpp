#include "abbe/settings/bounded_toml.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "abbe/base/faults.hpp"
#include "abbe/protocol/toml_nesting.hpp"

namespace abbe::daemon {
namespace {

Error too_deep(std::string_view text, std::size_t at, const std::string& file, std::size_t most) {
  const std::string_view before = text.substr(0, at);
  const auto line = 1 + static_cast<std::size_t>(std::count(before.begin(), before.end(), '\n'));
  const std::size_t line_begin = before.rfind('\n') + 1;  // npos + 1 is 0
  Faults faults(file);
  faults.add(line, at - line_begin + 1, "", fmt::format("nested deeper than {}", most));
  return faults.to_error();
}

}  // namespace

Result<toml::table> parse_toml(std::string_view text, const std::string& file,
                               const TomlBounds& bounds) {
  if (text.size() > bounds.bytes)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: {} bytes, at most {} are read", file, text.size(), bounds.bytes));
  if (const auto at = protocol::toml_deeper_than(text, bounds.depth))
    return tl::make_unexpected(too_deep(text, *at, file, bounds.depth));
  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error& error) {
    Faults faults(file);
    faults.add(error.source().begin.line, error.source().begin.column, "", error.description());
    return tl::make_unexpected(faults.to_error());
  }
}

Result<std::string> read_configuration_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  if (in && in.peek() != std::ifstream::traits_type::eof()) text << in.rdbuf();
  if (in.bad() || !in.is_open())
    return fail(ErrorCode::Io, fmt::format("read {}: {}", file.string(), std::strerror(errno)));
  return text.str();
}

}  // namespace abbe::daemon
