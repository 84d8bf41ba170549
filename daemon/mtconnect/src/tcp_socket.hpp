#pragma once
/// TCP sockets that do not block.

#include <cstdint>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::mtconnect {

/// Listens at a numeric IPv4 or IPv6 address.
[[nodiscard]] daemon::Result<daemon::FileDescriptor> listen_tcp(const std::string& address,
                                                                std::uint16_t port);
/// The port at which `fd` listens.
[[nodiscard]] std::uint16_t local_port(int fd);

struct Accepted {
  daemon::FileDescriptor fd;  ///< empty: errno states the cause
  std::string peer;           ///< "127.0.0.1:40312", "[::1]:40312"
};
/// The next connection. The kernel detects a peer that disappeared without closing the connection
/// (keep-alive), and buffers at most `send_buffer_bytes` for it.
[[nodiscard]] Accepted accept_tcp(int listener, int send_buffer_bytes);

}  // namespace abbe::mtconnect
