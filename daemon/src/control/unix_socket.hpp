#pragma once
/// Unix stream sockets. Ordinary world.

#include <filesystem>

#include "abbe/daemon/error.hpp"
#include "files/file_descriptor.hpp"

namespace abbe::daemon {

/// A listening socket at `path`, mode 0660. A socket file nobody answers at is replaced; one in use is an
/// Error.
[[nodiscard]] Result<FileDescriptor> listen_unix(const std::filesystem::path& path);
[[nodiscard]] Result<FileDescriptor> connect_unix(const std::filesystem::path& path);

}  // namespace abbe::daemon
