#pragma once
/// Sockets of a test that talks to the simulator over 127.0.0.1. Waiting is poll(2) on the socket,
/// never a sleep.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/sim/socket.hpp"

namespace abbe::sim::test {

inline sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

inline Socket connected(int type, std::uint16_t port) {
  Socket socket(::socket(AF_INET, type, 0));
  const sockaddr_in address = loopback(port);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    socket.close();
  return socket;
}

inline bool readable(int fd, int timeout_ms = 5000) {
  pollfd p{fd, POLLIN, 0};
  return ::poll(&p, 1, timeout_ms) == 1;
}

inline void send_bytes(const Socket& socket, std::span<const std::byte> bytes) {
  ::send(socket.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
}

/// One read; empty at the end of the stream.
inline std::vector<std::byte> receive_bytes(const Socket& socket) {
  std::vector<std::byte> bytes(65536);
  const ssize_t size =
      readable(socket.get()) ? ::recv(socket.get(), bytes.data(), bytes.size(), 0) : 0;
  bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return bytes;
}

}  // namespace abbe::sim::test
