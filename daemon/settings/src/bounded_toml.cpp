#include "abbe/settings/bounded_toml.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

namespace abbe::daemon {

Result<toml::table> parse_toml(std::string_view text, const std::string& file,
                               const TomlBounds& bounds) {
  return sections::parse_bounded(text, file, bounds).map_error([](sections::NotToml why) {
    return Error{ErrorCode::BadInput, std::move(why.text), std::move(why.details)};
  });
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
