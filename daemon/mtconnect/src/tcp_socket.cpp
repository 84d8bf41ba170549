#include "tcp_socket.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

namespace abbe::mtconnect {
namespace {

using daemon::ErrorCode;
using daemon::FileDescriptor;

constexpr int kBacklog = 16;
// Keep-alive detects a lost peer after 30 + 3 x 10 s.
constexpr int kKeepIdle_s = 30, kKeepInterval_s = 10, kKeepCount = 3;

using Addresses = std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)>;

Addresses numeric(const std::string& address, std::uint16_t port) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
  addrinfo* found = nullptr;
  if (::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found) != 0)
    found = nullptr;
  return {found, &::freeaddrinfo};
}

void set(int fd, int level, int option, int value) {
  (void)::setsockopt(fd, level, option, &value, sizeof value);
}

tl::unexpected<daemon::Error> refused(const std::string& address, std::uint16_t port) {
  const char* remedy = errno == EADDRINUSE
                           ? ": another process listens there; stop it, or set another port"
                       : errno == EADDRNOTAVAIL ? ": this computer does not have the address"
                       : errno == EACCES        ? ": ports below 1024 need a privilege"
                                                : "";
  return daemon::fail(ErrorCode::Io, fmt::format("listen at {}, port {}: {}{}", address, port,
                                                 std::strerror(errno), remedy));
}

std::string text_of(const sockaddr_storage& peer, socklen_t size) {
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> port{};
  // the socket API requires this cast
  const auto* generic = reinterpret_cast<const sockaddr*>(&peer);
  if (::getnameinfo(generic, size, host.data(), host.size(), port.data(), port.size(),
                    NI_NUMERICHOST | NI_NUMERICSERV) != 0)
    return "unknown address";
  return peer.ss_family == AF_INET6 ? fmt::format("[{}]:{}", host.data(), port.data())
                                    : fmt::format("{}:{}", host.data(), port.data());
}

}  // namespace

daemon::Result<FileDescriptor> listen_tcp(const std::string& address, std::uint16_t port) {
  const Addresses found = numeric(address, port);
  if (!found)
    return daemon::fail(ErrorCode::Usage,
                        fmt::format("address \"{}\": must be a numeric address of this computer, "
                                    "for example 127.0.0.1",
                                    address));

  FileDescriptor fd{
      ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, IPPROTO_TCP)};
  if (!fd) return refused(address, port);
  // allows listening after a restart, while old connections still occupy the port
  set(fd.get(), SOL_SOCKET, SO_REUSEADDR, 1);
  if (::bind(fd.get(), found->ai_addr, found->ai_addrlen) != 0 || ::listen(fd.get(), kBacklog) != 0)
    return refused(address, port);
  return fd;
}

std::uint16_t local_port(int fd) {
  sockaddr_storage own{};
  socklen_t size = sizeof own;
  if (::getsockname(fd, reinterpret_cast<sockaddr*>(&own), &size) != 0) return 0;
  // sockaddr_in and sockaddr_in6 have the port in the same place.
  return ntohs(reinterpret_cast<const sockaddr_in&>(own).sin_port);
}

Accepted accept_tcp(int listener, int send_buffer_bytes) {
  sockaddr_storage peer{};
  socklen_t size = sizeof peer;
  FileDescriptor fd{
      ::accept4(listener, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_CLOEXEC | SOCK_NONBLOCK)};
  if (!fd) return {};

  set(fd.get(), IPPROTO_TCP, TCP_NODELAY, 1);
  set(fd.get(), SOL_SOCKET, SO_SNDBUF, send_buffer_bytes);
  set(fd.get(), SOL_SOCKET, SO_KEEPALIVE, 1);
  set(fd.get(), IPPROTO_TCP, TCP_KEEPIDLE, kKeepIdle_s);
  set(fd.get(), IPPROTO_TCP, TCP_KEEPINTVL, kKeepInterval_s);
  set(fd.get(), IPPROTO_TCP, TCP_KEEPCNT, kKeepCount);
  return {std::move(fd), text_of(peer, size)};
}

}  // namespace abbe::mtconnect
