#pragma once

#include <filesystem>
#include <span>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Usage if a file to write is also a file that the command reads, or is to be written twice. Empty
/// names are skipped.
[[nodiscard]] Result<void> require_own_files(std::span<const std::filesystem::path> read,
                                             std::span<const std::filesystem::path> written);

/// Io if the folder of the file does not exist, or if the file exists and is not a regular file.
[[nodiscard]] Result<void> require_place_of(const std::filesystem::path& file);

}  // namespace abbe::daemon
