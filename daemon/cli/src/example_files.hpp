#pragma once
/// The commented example files, embedded when abbe is built.

#include <span>
#include <string_view>

namespace abbe::daemon {

struct EmbeddedText {
  std::string_view name;  ///< name of the file, without folder
  std::string_view text;
};

/// The files, in the order in which `abbe example` lists them.
[[nodiscard]] std::span<const EmbeddedText> example_files() noexcept;

}  // namespace abbe::daemon
