#pragma once
/// Files with secrets: users of the page, tokens and passwords of receivers of notifications. They
/// belong to root or to the program's user. The group of the file may read them; other users may
/// not.

#include <filesystem>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Checks owner and mode of the file. Io if the file cannot be examined. BadInput if other users
/// may read or change it; the text states what to do.
[[nodiscard]] Result<void> check_secret_mode(const std::filesystem::path& file);

/// The first line of the file, without the line end. BadInput also if it is empty, longer than 4
/// kB, followed by further lines, or has control characters.
[[nodiscard]] Result<std::string> read_secret(const std::filesystem::path& file);

}  // namespace abbe::daemon
