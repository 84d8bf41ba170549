#pragma once
/// Reads and writes whole files.

#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// The bytes of a file. The file is read, not mapped into memory: if a mapped file shrinks, the
/// process is killed by SIGBUS.
[[nodiscard]] Result<std::string> read_text(const std::filesystem::path& file);

/// Same as read_text(), but the file must be a regular file of at most 1 GiB. A pipe or a device is
/// BadInput; the call does not wait for it.
[[nodiscard]] Result<std::string> read_regular_file(const std::filesystem::path& file);

/// Writes a temporary file in the same folder, syncs it to the disk and renames it: after a power
/// failure the file has either its old or its new content. An existing file keeps its owner and
/// mode. A new file gets owner and mode of its folder, but is never writable by others: the daemon
/// can read what root writes there.
[[nodiscard]] Result<void> replace_file(const std::filesystem::path& file, std::string_view text);

/// Removes the temporary files that killed processes left behind in replace_file(file, ...).
void remove_half_written(const std::filesystem::path& file);

/// Owner and mode of a folder that root creates. LikeItsParent: those of the parent folder, so that
/// the owner of the parent can use the new folder. OfTheCaller: owner and umask of this process.
enum class NewFolder { LikeItsParent, OfTheCaller };

/// Creates `folder` and its missing parents.
[[nodiscard]] Result<void> create_folder(const std::filesystem::path& folder,
                                         NewFolder kind = NewFolder::LikeItsParent);

/// Gives the newly created file `fd` the owner and mode of `folder`, which contains it. Failures
/// are ignored, because only root may change the owner.
void inherit_ownership(int fd, const std::filesystem::path& folder) noexcept;

}  // namespace abbe::daemon
