#pragma once
/// Whole files in and out.

#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// The bytes of a file. One read, not a mapping: a file that shrinks under a mapping kills the
/// process.
[[nodiscard]] Result<std::string> read_text(const std::filesystem::path& file);

/// The same of what must be a regular file of at most 1 GiB: a pipe or device in its place is
/// BadInput and is not waited for.
[[nodiscard]] Result<std::string> read_regular_file(const std::filesystem::path& file);

/// Writes a new file beside the old one, forces it to the disk and renames it: after a power cut
/// either the old or the new content is there. Owner and mode stay those of the file; a new file
/// gets those of its folder (never writable by others), whoever writes it: what root writes for the
/// daemon, the daemon can read.
[[nodiscard]] Result<void> replace_file(const std::filesystem::path& file, std::string_view text);

/// With all folders above; each new one gets owner and mode of the one it is in.
[[nodiscard]] Result<void> create_folder(const std::filesystem::path& folder);

/// Owner and mode of an open file that was created just now, from the folder it is in. Best effort:
/// only root may give files away.
void take_after_folder(int fd, const std::filesystem::path& folder) noexcept;

}  // namespace abbe::daemon
