#pragma once
/// Functions that the readers of files of other programs share: recognition, and the message that
/// names the options that such a file needs.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// The first 64 KiB of a regular file. Empty for any other file, because its contents can be read
/// only once.
[[nodiscard]] std::string head_of(const std::filesystem::path& file);

/// True if the first line that is not a comment contains names of abbe's columns: x_mm, range_mm,
/// ...
[[nodiscard]] bool is_own_csv(std::string_view head);

/// The Error BadInput "FILE: WHAT needs:", with a line for each of `missing`.
[[nodiscard]] Error needs_options(const std::string& file, std::string_view what,
                                  std::vector<std::string> missing);
/// The Error BadInput that `options` apply only to files of other programs.
[[nodiscard]] Error options_without_use(const std::string& file, std::string_view options);

}  // namespace abbe::daemon
