#include "connection_stream.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <openssl/err.h>
#include <poll.h>
#include <strings.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <string_view>
#include <utility>

namespace abbe::web {
namespace {

constexpr std::chrono::milliseconds kWaitStep{200};  ///< between two looks at ConnectionWatch

using ReadName = int(int, sockaddr*, socklen_t*);  ///< ::getpeername or ::getsockname

void read_address(int fd, ReadName* name, std::string& address, int& port) {
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

std::string client_address(int fd) {
  std::string address;
  int port = 0;
  read_address(fd, ::getpeername, address, port);
  return address;
}

ConnectionStream::ConnectionStream(int fd, SSL_CTX* tls, ConnectionLimits limits,
                                   ConnectionWatch watch)
    : fd_(fd), limits_(limits), watch_(std::move(watch)) {
  (void)::fcntl(fd_, F_SETFL, ::fcntl(fd_, F_GETFL) | O_NONBLOCK);
  if (tls == nullptr) return;
  tls_.reset(SSL_new(tls));
  if (tls_) SSL_set_fd(tls_.get(), fd_);
}

ConnectionStream::~ConnectionStream() {
  if (tls_ && fault_ == Fault::None) SSL_shutdown(tls_.get());
  ERR_clear_error();  // the next connection of this thread would take an error for its own
}

bool ConnectionStream::wait(short events, Clock::time_point until,
                            Clock::time_point until_if_crowded) const {
  for (;;) {
    crowded_out_ = until_if_crowded < until && watch_.crowded();
    const auto end = crowded_out_ ? until_if_crowded : until;
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
    if (left.count() <= 0 || watch_.stopping()) return false;
    pollfd polled{.fd = fd_, .events = events, .revents = 0};
    const int ready = ::poll(&polled, 1, static_cast<int>(std::min(left, kWaitStep).count()));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
}

/// For more of a request, or of the handshake before the first one.
bool ConnectionStream::wait_for_client(short events) const {
  return wait(events, request_since_ + limits_.request_time, request_since_ + kCrowdedTime);
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
  for (;;) {
    const int done = SSL_accept(tls_.get());
    if (done == 1) return true;
    const short event = event_for(done);
    if (event == 0 || !wait_for_client(event)) return false;
  }
}

bool ConnectionStream::wait_for_request(std::chrono::milliseconds time_out) {
  if (at_ < filled_ || (tls_ && SSL_pending(tls_.get()) > 0)) return true;
  const auto until = Clock::now() + time_out;
  return wait(POLLIN, until, until);
}

bool ConnectionStream::read_head() {
  request_since_ = Clock::now();
  sent_ = 0;
  waited_ = {};
  std::copy(buffer_.data() + at_, buffer_.data() + filled_, buffer_.data());
  filled_ -= at_;
  at_ = 0;

  constexpr std::string_view kEnd = "\r\n\r\n";
  for (std::size_t searched = 0;;) {
    const auto end = std::string_view{buffer_.data(), filled_}.find(kEnd, searched);
    if (end != std::string_view::npos) return check_head(end + kEnd.size());
    if (filled_ == buffer_.size()) {
      fault_ = Fault::LongHead;
      return false;
    }
    searched = filled_ - std::min(filled_, kEnd.size() - 1);
    const ssize_t n = receive(buffer_.data() + filled_, buffer_.size() - filled_);
    if (n <= 0) return false;
    filled_ += static_cast<std::size_t>(n);
  }
}

bool ConnectionStream::check_head(std::size_t end) {
  left_ = end + limits_.body_bytes;
  constexpr std::size_t kLongestLine = 8000;  // httplib has 8192
  std::size_t lines = 0;
  for (std::size_t begin = 0; begin < end; ++lines) {
    const std::string_view rest{buffer_.data() + begin, end - begin};
    const std::size_t size = rest.find('\n') + 1;  // the head ends with a line feed
    if (size > kLongestLine || lines > kMostHeadLines) {
      fault_ = Fault::LongHead;
      return false;
    }
    constexpr std::string_view kRange = "range";
    if (::strncasecmp(rest.data(), kRange.data(), kRange.size()) == 0)
      buffer_[begin] = kRangeHeader[0];
    begin += size;
  }
  return true;
}

bool ConnectionStream::is_readable() const {
  return at_ < filled_ || wait_for_client(POLLIN);
}

bool ConnectionStream::is_writable() const {
  return wait_for_reader(POLLOUT);
}

bool ConnectionStream::wait_for_reader(short events) const {
  const auto begin = Clock::now();
  const auto for_sent = std::chrono::seconds{sent_ / kSlowestReader_bytes_per_s};
  const auto end = [&](std::chrono::milliseconds time) {
    return begin + std::min<std::chrono::nanoseconds>(time, time + for_sent - waited_);
  };
  const bool ready = wait(events, end(limits_.write_time), end(kCrowdedTime));
  waited_ += Clock::now() - begin;
  if (!ready && !watch_.stopping()) fault_ = crowded_out_ ? Fault::Crowded : Fault::SlowReader;
  return ready;
}

ssize_t ConnectionStream::read(char* to, std::size_t size) {
  if (at_ == filled_) {
    const ssize_t n = receive(buffer_.data(), buffer_.size());
    if (n <= 0) return n;
    at_ = 0;
    filled_ = static_cast<std::size_t>(n);
  }
  if (left_ == 0) {
    fault_ = Fault::LongBody;
    return -1;
  }
  const std::size_t n = std::min({size, filled_ - at_, left_});
  std::copy_n(buffer_.data() + at_, n, to);
  at_ += n;
  left_ -= n;
  return static_cast<ssize_t>(n);
}

ssize_t ConnectionStream::receive(char* to, std::size_t size) {
  for (;;) {
    short event = POLLIN;
    if (tls_) {
      const int n = SSL_read(tls_.get(), to, static_cast<int>(size));
      if (n > 0) return n;
      if (SSL_get_error(tls_.get(), n) == SSL_ERROR_ZERO_RETURN) return 0;
      event = event_for(n);
    } else {
      const ssize_t n = ::recv(fd_, to, size, 0);
      if (n >= 0) return n;
      if (errno != EAGAIN && errno != EINTR) return -1;
    }
    if (event == 0) return -1;
    if (wait_for_client(event)) continue;
    if (!watch_.stopping()) fault_ = crowded_out_ ? Fault::Crowded : Fault::SlowRequest;
    return -1;
  }
}

ssize_t ConnectionStream::write(const char* from, std::size_t size) {
  constexpr std::size_t kMostAtOnce = 1u << 16;
  for (;;) {
    short event = POLLOUT;
    if (tls_) {
      const int n = SSL_write(tls_.get(), from, static_cast<int>(std::min(size, kMostAtOnce)));
      if (n > 0) sent_ += static_cast<std::size_t>(n);
      if (n > 0) return n;
      event = event_for(n);
    } else {
      const ssize_t n = ::send(fd_, from, size, MSG_NOSIGNAL);
      if (n > 0) sent_ += static_cast<std::size_t>(n);
      if (n >= 0) return n;
      if (errno != EAGAIN && errno != EINTR) return -1;
    }
    if (event == 0 || !wait_for_reader(event)) return -1;
  }
}

void ConnectionStream::get_remote_ip_and_port(std::string& address, int& port) const {
  read_address(fd_, ::getpeername, address, port);
}

void ConnectionStream::get_local_ip_and_port(std::string& address, int& port) const {
  read_address(fd_, ::getsockname, address, port);
}

}  // namespace abbe::web
