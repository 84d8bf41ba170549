#include "abbe/drivers/tcp_client.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <system_error>
#include <utility>

namespace abbe::drivers {
namespace {

/// Longest time of one wait in the kernel; the caller calls wait() again.
constexpr std::chrono::seconds kLongestPoll{1};

std::string error_text(int error) {
  return std::system_category().message(error);
}

auto failed(ErrorCode code, std::string text) {
  return tl::unexpected{Error{code, std::move(text)}};
}

bool try_again(int error) {
  return error == EAGAIN || error == EWOULDBLOCK || error == EINTR;
}

}  // namespace

void TcpClient::look_up(const std::string& host, std::uint16_t port) {
  host_ = std::make_unique<HostAddresses>(host, port);
}

Result<void> TcpClient::open() {
  close();
  if (!host_) return failed(ErrorCode::BadConfiguration, "no address: no host is given");
  const auto address = host_->next();
  if (!address) return tl::unexpected{address.error()};
  const auto* at = reinterpret_cast<const sockaddr*>(&address->at);  // NOLINT: sockets interface
  fd_ = ::socket(at->sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0)
    return failed(ErrorCode::SystemRefused, fmt::format("no socket: {}", error_text(errno)));
  const int yes = 1;
  ::setsockopt(fd_, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);

  if (::connect(fd_, at, address->length) != 0 && errno != EINPROGRESS) {
    const int error = errno;
    close();
    return failed(ErrorCode::Unreachable, fmt::format("no connection: {}", error_text(error)));
  }

  opening_ = true;  // also if connect() is complete at once: wait() then reports Established
  return {};
}

void TcpClient::close() noexcept {
  if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  opening_ = false;
  unsent_.clear();
}

void TcpClient::finish() noexcept {
  if (!established()) return;
  ::shutdown(fd_, SHUT_WR);
  // Unread bytes are read first: closing a socket with unread bytes resets the connection, and the
  // peer may lose the bytes just written.
  std::array<std::byte, 4096> discarded;  // NOLINT(cppcoreguidelines-pro-type-member-init)
  for (int i = 0; i < 1000 && ::recv(fd_, discarded.data(), discarded.size(), MSG_DONTWAIT) > 0;
       ++i) {
  }
}

Result<TcpClient::Ready> TcpClient::wait(std::chrono::nanoseconds wall) {
  using std::chrono::nanoseconds;
  const bool writing = opening_ || !unsent_.empty();
  pollfd descriptor{fd_, static_cast<short>(writing ? POLLIN | POLLOUT : POLLIN), 0};
  const nanoseconds bounded = std::clamp<nanoseconds>(wall, nanoseconds{0}, kLongestPoll);
  const auto whole = std::chrono::floor<std::chrono::seconds>(bounded);
  const timespec timeout{whole.count(), (bounded - whole).count()};
  const int ready = ::ppoll(&descriptor, closed() ? 0 : 1, &timeout, nullptr);
  if (ready <= 0) return Ready::Nothing;
  if (opening_) return end_of_opening();

  if ((descriptor.revents & POLLOUT) != 0) {
    if (const auto sent = flush(); !sent) return tl::unexpected{sent.error()};
  }

  const bool something = (descriptor.revents & (POLLIN | POLLERR | POLLHUP)) != 0;
  return something ? Ready::Readable : Ready::Nothing;
}

Result<TcpClient::Ready> TcpClient::end_of_opening() {
  int error = 0;
  socklen_t size = sizeof error;
  ::getsockopt(fd_, SOL_SOCKET, SO_ERROR, &error, &size);
  if (error != 0) {
    close();
    return failed(ErrorCode::Unreachable, fmt::format("no connection: {}", error_text(error)));
  }
  opening_ = false;
  return Ready::Established;
}

Result<std::size_t> TcpClient::read(std::span<std::byte> into) {
  const ssize_t n = ::recv(fd_, into.data(), into.size(), MSG_DONTWAIT);
  if (n > 0) return static_cast<std::size_t>(n);
  if (n == 0) return failed(ErrorCode::Unreachable, "connection closed by the peer");
  if (try_again(errno)) return std::size_t{0};
  return failed(ErrorCode::Unreachable, fmt::format("connection lost: {}", error_text(errno)));
}

Result<void> TcpClient::write(std::span<const std::byte> bytes) {
  unsent_.insert(unsent_.end(), bytes.begin(), bytes.end());
  return flush();
}

Result<void> TcpClient::flush() {
  while (!unsent_.empty()) {
    const ssize_t n = ::send(fd_, unsent_.data(), unsent_.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0 && try_again(errno)) return {};
    if (n < 0)
      return failed(ErrorCode::Unreachable, fmt::format("connection lost: {}", error_text(errno)));
    unsent_.erase(unsent_.begin(), unsent_.begin() + n);
  }
  return {};
}

}  // namespace abbe::drivers
