#include "abbe/sim/socket.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace abbe::sim {
namespace {

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

tl::unexpected<Error> refused(const char* kind, std::uint16_t port) {
  const int cause = errno;
  const char* hint = cause == EADDRINUSE
                         ? " (another program uses the port; choose another, or 0 for a free one)"
                         : "";
  return io_error(
      fmt::format("{} port 127.0.0.1:{}: {}{}", kind, port, std::strerror(cause), hint));
}

Result<Socket> bound(int type, const char* kind, std::uint16_t port) {
  Socket socket(::socket(AF_INET, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket) return refused(kind, port);
  const int on = 1;
  if (type == SOCK_STREAM) setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const sockaddr_in address = loopback(port);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return refused(kind, port);
  }
  return socket;
}

}  // namespace

void Socket::close() {
  if (fd_ >= 0) ::close(std::exchange(fd_, -1));
}

Result<Socket> listen_tcp(std::uint16_t port) {
  auto socket = bound(SOCK_STREAM, "TCP", port);
  if (socket && ::listen(socket->get(), 4) != 0) return refused("TCP", port);
  return socket;
}

Result<Socket> bind_udp(std::uint16_t port) {
  return bound(SOCK_DGRAM, "UDP", port);
}

std::uint16_t port_of(const Socket& socket) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin_port);
}

sockaddr_storage loopback_address(std::uint16_t port) {
  const sockaddr_in address = loopback(port);
  sockaddr_storage storage{};
  std::memcpy(&storage, &address, sizeof address);
  return storage;
}

void send_what_fits(const Socket& client, std::vector<std::byte>& unsent, std::size_t most) {
  most = std::min(most, unsent.size());
  std::size_t done = 0;
  while (done < most) {
    const ssize_t size =
        ::send(client.get(), unsent.data() + done, most - done, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (size <= 0) break;
    done += static_cast<std::size_t>(size);
  }
  unsent.erase(unsent.begin(), unsent.begin() + static_cast<std::ptrdiff_t>(done));
}

void add_client_fd(int client_fd, bool wants_write, std::vector<pollfd>& fds) {
  const short events = static_cast<short>(wants_write ? POLLIN | POLLOUT : POLLIN);
  if (client_fd >= 0) fds.push_back({client_fd, events, 0});
}

void add_server_fds(const Socket& listener, const Socket& client, bool wants_write,
                    std::vector<pollfd>& fds) {
  fds.push_back({listener.get(), POLLIN, 0});
  add_client_fd(client.get(), wants_write, fds);
}

}  // namespace abbe::sim
