#pragma once
/// What the readers of files of other programs have in common: recognition, and the message that
/// names the options that such a file needs.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// The first 64 KiB of a regular file; empty for any other file, from which one can read once only.
[[nodiscard]] std::string head_of(const std::filesystem::path& file);

/// True if the first line that is no comment names columns of abbe: x_mm, range_mm, ...
[[nodiscard]] bool is_own_csv(std::string_view head);

/// BadInput "FILE: WHAT needs:", and a line for each of `missing`.
[[nodiscard]] Error needs_options(const std::string& file, std::string_view what,
                                  std::vector<std::string> missing);
/// BadInput: `options` are for files of other programs only.
[[nodiscard]] Error options_without_use(const std::string& file, std::string_view options);

}  // namespace abbe::daemon
