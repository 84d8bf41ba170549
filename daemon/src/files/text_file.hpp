#pragma once
/// Whole files in and out.

#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/daemon/error.hpp"

namespace abbe::daemon {

/// The bytes of a file. One read, not a mapping: a file that shrinks under a mapping kills the process.
[[nodiscard]] Result<std::string> read_text(const std::filesystem::path& file);

/// Writes a new file beside the old one, forces it to the disk and renames it: after a power cut either the
/// old or the new content is there.
[[nodiscard]] Result<void> replace_file(const std::filesystem::path& file, std::string_view text);

}  // namespace abbe::daemon
