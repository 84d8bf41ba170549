#include "connection_stream.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <openssl/err.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace abbe::web {
namespace {

constexpr std::chrono::milliseconds kWaitStep{200};  ///< between two looks at `stopping`

/// `name`: ::getpeername or ::getsockname.
void read_address(int fd, int (*name)(int, sockaddr*, socklen_t*), std::string& address,
                  int& port) {
  sockaddr_storage seen{};
  socklen_t size = sizeof seen;
  auto* const any = reinterpret_cast<sockaddr*>(&seen);  // NOLINT: the interface of sockets
  if (name(fd, any, &size) != 0) return;
  std::array<char, INET6_ADDRSTRLEN> text{};
  const bool v6 = seen.ss_family == AF_INET6;
  const auto* const in4 = reinterpret_cast<const sockaddr_in*>(&seen);   // NOLINT
  const auto* const in6 = reinterpret_cast<const sockaddr_in6*>(&seen);  // NOLINT
  const void* const bytes = v6 ? static_cast<const void*>(&in6->sin6_addr) : &in4->sin_addr;
  if (::inet_ntop(seen.ss_family, bytes, text.data(), text.size()) == nullptr) return;
  address = text.data();
  port = ntohs(v6 ? in6->sin6_port : in4->sin_port);
}

}  // namespace

ConnectionStream::ConnectionStream(int fd, SSL_CTX* tls, ConnectionLimits limits,
                                   std::function<bool()> stopping)
    : fd_(fd), limits_(limits), stopping_(std::move(stopping)) {
  (void)::fcntl(fd_, F_SETFL, ::fcntl(fd_, F_GETFL) | O_NONBLOCK);
  if (tls == nullptr) return;
  tls_.reset(SSL_new(tls));
  if (tls_) SSL_set_fd(tls_.get(), fd_);
}

ConnectionStream::~ConnectionStream() {
  if (tls_ && fault_ == Fault::None) SSL_shutdown(tls_.get());
}

bool ConnectionStream::wait(short events, Clock::time_point until) const {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
    if (left.count() <= 0 || stopping_()) return false;
    pollfd polled{.fd = fd_, .events = events, .revents = 0};
    const int ready = ::poll(&polled, 1, static_cast<int>(std::min(left, kWaitStep).count()));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
}

short ConnectionStream::event_for(int tls_result) const {
  switch (SSL_get_error(tls_.get(), tls_result)) {
    case SSL_ERROR_WANT_READ:
      return POLLIN;
    case SSL_ERROR_WANT_WRITE:
      return POLLOUT;
    default:
      ERR_clear_error();
      return 0;
  }
}

bool ConnectionStream::accept() {
  if (!tls_) return false;
  const auto until = Clock::now() + limits_.request_time;
  for (;;) {
    const int done = SSL_accept(tls_.get());
    if (done == 1) return true;
    const short event = event_for(done);
    if (event == 0 || !wait(event, until)) return false;
  }
}

bool ConnectionStream::wait_for_request(std::chrono::milliseconds time_out) {
  if (at_ < filled_ || (tls_ && SSL_pending(tls_.get()) > 0)) return true;
  return wait(POLLIN, Clock::now() + time_out);
}

void ConnectionStream::begin_request() {
  left_ = limits_.request_bytes;
  request_until_ = Clock::now() + limits_.request_time;
}

bool ConnectionStream::is_readable() const {
  return at_ < filled_ || wait(POLLIN, request_until_);
}

bool ConnectionStream::is_writable() const {
  return wait(POLLOUT, Clock::now() + limits_.write_time);
}

ssize_t ConnectionStream::read(char* to, std::size_t size) {
  if (at_ == filled_) {
    const ssize_t n = fill_buffer();
    if (n <= 0) return n;
  }
  if (left_ == 0) {
    fault_ = Fault::TooLarge;
    return -1;
  }
  const std::size_t n = std::min({size, filled_ - at_, left_});
  std::copy_n(buffer_.data() + at_, n, to);
  at_ += n;
  left_ -= n;
  return static_cast<ssize_t>(n);
}

ssize_t ConnectionStream::fill_buffer() {
  for (;;) {
    short event = POLLIN;
    if (tls_) {
      const int n = SSL_read(tls_.get(), buffer_.data(), static_cast<int>(buffer_.size()));
      if (n > 0) filled_ = static_cast<std::size_t>(n);
      if (n > 0) break;
      if (SSL_get_error(tls_.get(), n) == SSL_ERROR_ZERO_RETURN) return 0;
      event = event_for(n);
    } else {
      const ssize_t n = ::recv(fd_, buffer_.data(), buffer_.size(), 0);
      if (n > 0) filled_ = static_cast<std::size_t>(n);
      if (n > 0) break;
      if (n == 0) return 0;
      if (errno != EAGAIN && errno != EINTR) return -1;
    }
    if (event == 0) return -1;
    if (wait(event, request_until_)) continue;
    if (!stopping_()) fault_ = Fault::TooSlow;
    return -1;
  }
  at_ = 0;
  return static_cast<ssize_t>(filled_);
}

ssize_t ConnectionStream::write(const char* from, std::size_t size) {
  const auto until = Clock::now() + limits_.write_time;
  constexpr std::size_t kMostAtOnce = 1u << 16;
  for (;;) {
    short event = POLLOUT;
    if (tls_) {
      const int n = SSL_write(tls_.get(), from, static_cast<int>(std::min(size, kMostAtOnce)));
      if (n > 0) return n;
      event = event_for(n);
    } else {
      const ssize_t n = ::send(fd_, from, size, MSG_NOSIGNAL);
      if (n >= 0) return n;
      if (errno != EAGAIN && errno != EINTR) return -1;
    }
    if (event == 0 || !wait(event, until)) return -1;
  }
}

void ConnectionStream::get_remote_ip_and_port(std::string& address, int& port) const {
  read_address(fd_, ::getpeername, address, port);
}

void ConnectionStream::get_local_ip_and_port(std::string& address, int& port) const {
  read_address(fd_, ::getsockname, address, port);
}

}  // namespace abbe::web
