#pragma once
/// Unix sockets. Ordinary world.

#include <chrono>
#include <filesystem>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::daemon {

/// A listening socket at `path`, mode 0660. A socket file nobody answers at is replaced; one in use
/// is an Error.
[[nodiscard]] Result<FileDescriptor> listen_unix(const std::filesystem::path& path);

/// A listener that accepts nobody is an Error after `time_out`.
[[nodiscard]] Result<FileDescriptor> connect_unix(
    const std::filesystem::path& path,
    std::chrono::milliseconds time_out = std::chrono::seconds{2});

/// For datagrams; fails at once where nobody listens.
[[nodiscard]] Result<FileDescriptor> connect_unix_datagrams(const std::filesystem::path& path);

/// Whether a process listens at `path`, even one that accepts nobody. Does not wait for it.
[[nodiscard]] bool is_listened_at(const std::filesystem::path& path);

/// A send on `fd` that makes no progress for so long fails with EAGAIN; 0: it waits for ever.
void set_send_time_out(int fd, std::chrono::milliseconds time_out) noexcept;

}  // namespace abbe::daemon
