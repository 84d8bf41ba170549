#pragma once
/// Functions that the readers of TOML files share.

#include <toml++/toml.h>
#include <filesystem>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "abbe/settings/section.hpp"

namespace abbe::daemon {

struct TomlFile {
  InputFile source;
  toml::table table;
};

/// BadInput if the text is not TOML. `file`: its name in messages.
[[nodiscard]] inline Result<TomlFile> parse_toml_text(std::string_view text,
                                                      const std::filesystem::path& file,
                                                      const TomlBounds& bounds = {}) {
  auto table = parse_toml(text, file.string(), bounds);
  ABBE_TRY(table);
  return TomlFile{{file.filename().string(), sha256_hex(text)}, std::move(*table)};
}

/// Io if the file cannot be read, BadInput if it is not TOML.
[[nodiscard]] inline Result<TomlFile> parse_toml_file(const std::filesystem::path& file,
                                                      const TomlBounds& bounds = {}) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_toml_text(*text, file, bounds);
}

}  // namespace abbe::daemon
