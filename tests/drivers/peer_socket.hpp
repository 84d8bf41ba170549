#pragma once
/// What the simulated peers of these tests listen with.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cstdint>

#include "abbe/sim/socket.hpp"

namespace abbe::tests {

/// A TCP socket on `port` of 127.0.0.1; 0: the kernel chooses. Two may hold one port: a peer keeps
/// it with a second socket, so that the port stays its own while it is unplugged.
inline sim::Socket bound_socket(std::uint16_t port) {
  sim::Socket s(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const int yes = 1;
  ::setsockopt(s.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  ::setsockopt(s.get(), SOL_SOCKET, SO_REUSEPORT, &yes, sizeof yes);
  sockaddr_in a{};
  a.sin_family = AF_INET;
  a.sin_port = htons(port);
  a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(::bind(s.get(), reinterpret_cast<const sockaddr*>(&a), sizeof a), 0);
  return s;
}

}  // namespace abbe::tests
