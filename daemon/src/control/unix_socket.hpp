#pragma once
/// Unix stream sockets and the ownership of a file descriptor. Ordinary world.

#include <unistd.h>

#include <filesystem>
#include <utility>

#include "abbe/daemon/error.hpp"

namespace abbe::daemon {

/// Owns a file descriptor; closes it once.
class FileDescriptor {
 public:
  FileDescriptor() noexcept = default;
  explicit FileDescriptor(int fd) noexcept : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  [[nodiscard]] int get() const noexcept { return fd_; }
  explicit operator bool() const noexcept { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

/// A listening socket at `path`, mode 0660. A socket file nobody answers at is replaced; one in use is an
/// Error.
[[nodiscard]] Result<FileDescriptor> listen_unix(const std::filesystem::path& path);
[[nodiscard]] Result<FileDescriptor> connect_unix(const std::filesystem::path& path);

}  // namespace abbe::daemon
