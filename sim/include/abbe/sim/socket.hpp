#pragma once
/// An owning file descriptor, the two kinds of loopback endpoint of the simulator, and helper
/// functions for a server with one client. All non-blocking.

#include <poll.h>
#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

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

/// Sockets bound to 127.0.0.1; port 0: the kernel chooses. Error Io if the port is in use; the text
/// names it.
[[nodiscard]] Result<Socket> listen_tcp(std::uint16_t port);
[[nodiscard]] Result<Socket> bind_udp(std::uint16_t port);
[[nodiscard]] std::uint16_t port_of(const Socket& socket);
/// The address 127.0.0.1 with this port, in the form that sendto() requires.
[[nodiscard]] sockaddr_storage loopback_address(std::uint16_t port);
/// Sends at most `most` bytes of `unsent` without blocking and removes the bytes sent.
void send_what_fits(const Socket& client, std::vector<std::byte>& unsent,
                    std::size_t most = std::numeric_limits<std::size_t>::max());
/// Adds the client's socket to the sockets to wait for; -1: there is no client.
void add_client_fd(int client_fd, bool wants_write, std::vector<pollfd>& fds);
/// Adds the listener and the client to the sockets to wait for; `client` may be closed.
void add_server_fds(const Socket& listener, const Socket& client, bool wants_write,
                    std::vector<pollfd>& fds);

}  // namespace abbe::sim
