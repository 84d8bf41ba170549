#pragma once
/// Unix sockets. Not for real-time threads.

#include <chrono>
#include <filesystem>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::daemon {

/// A listening socket at `path`, mode 0660. A socket file without a listener is replaced; a socket
/// in use is an Error.
[[nodiscard]] Result<FileDescriptor> listen_unix(const std::filesystem::path& path);

/// Connects to the stream socket at `path`. An Error if the listener does not accept the connection
/// within `time_out`.
[[nodiscard]] Result<FileDescriptor> connect_unix(
    const std::filesystem::path& path,
    std::chrono::milliseconds time_out = std::chrono::seconds{2});

/// Connects to the datagram socket at `path`; fails at once if no process listens there.
[[nodiscard]] Result<FileDescriptor> connect_unix_datagrams(const std::filesystem::path& path);

/// True if a process listens at `path`, even if it accepts no connection. Does not block.
[[nodiscard]] bool is_listened_at(const std::filesystem::path& path);

/// Sets a time-out: a send on `fd` that makes no progress for `time_out` fails with EAGAIN; with 0
/// it waits forever.
void set_send_time_out(int fd, std::chrono::milliseconds time_out) noexcept;

}  // namespace abbe::daemon
