#pragma once
/// Where the points of `abbe verify` come from when not out of a file.

#include <filesystem>
#include <string>

#include "abbe/daemon/error.hpp"
#include "abbe/daemon/input_files.hpp"

namespace abbe::daemon {

/// The standstills of a recording.
[[nodiscard]] Result<VerificationFile> points_of_recording(const std::string& file);

/// The standstills of the machine the daemon watches, one line on stderr for each, until there are `count`
/// (0: no limit) or somebody presses Ctrl-C. They come from no file: `source` has no name.
[[nodiscard]] Result<VerificationFile> points_of_daemon(const std::filesystem::path& socket,
                                                        std::size_t count);

}  // namespace abbe::daemon
