#pragma once
/// A file descriptor with an owner, and the two kinds of loopback endpoint the simulator needs. All
/// non-blocking.

#include <sys/socket.h>

#include <cstdint>
#include <utility>

#include "abbe/sim/error.hpp"

namespace abbe::sim {

class Socket {
 public:
  Socket() = default;
  explicit Socket(int fd) : fd_(fd) {}
  Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Socket& operator=(Socket&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() { close(); }

  void close();
  [[nodiscard]] int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

/// Bound to 127.0.0.1; port 0: the kernel chooses. Io when the port is taken: the text says which.
[[nodiscard]] Result<Socket> listen_tcp(std::uint16_t port);
[[nodiscard]] Result<Socket> bind_udp(std::uint16_t port);
[[nodiscard]] std::uint16_t port_of(const Socket& socket);
/// 127.0.0.1 with this port, as sendto() wants it.
[[nodiscard]] sockaddr_storage loopback_address(std::uint16_t port);

}  // namespace abbe::sim
