#include "abbe/drivers/lines/link.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <optional>
#include <system_error>
#include <type_traits>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::drivers {
namespace {

/// Longest time of one wait in the kernel; the caller calls wait() again.
constexpr std::chrono::seconds kLongestLinkWait{1};

auto no_link(ErrorCode code, const char* what, int error) {
  return tl::unexpected{
      Error{code, fmt::format("{}: {}", what, std::system_category().message(error))}};
}

bool nothing_yet(int error) {
  return error == EAGAIN || error == EWOULDBLOCK || error == EINTR;
}

void close_descriptor(int& fd) noexcept {
  if (fd >= 0) ::close(std::exchange(fd, -1));
}

std::optional<speed_t> speed_of(int baud) {
  constexpr std::array<std::pair<int, speed_t>, 14> kSpeeds{{{300, B300},
                                                             {600, B600},
                                                             {1200, B1200},
                                                             {2400, B2400},
                                                             {4800, B4800},
                                                             {9600, B9600},
                                                             {19200, B19200},
                                                             {38400, B38400},
                                                             {57600, B57600},
                                                             {115200, B115200},
                                                             {230400, B230400},
                                                             {460800, B460800},
                                                             {921600, B921600},
                                                             {1000000, B1000000}}};
  const auto* const found =
      std::ranges::find(kSpeeds, baud, [](const auto& entry) { return entry.first; });
  return found == kSpeeds.end() ? std::nullopt : std::optional{found->second};
}

/// An address of this computer: a literal, so no name service is asked.
struct LocalAddress {
  sockaddr_storage at{};
  socklen_t length = 0;
};
std::optional<LocalAddress> local_address(const std::string& host, std::uint16_t port) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0)
    return std::nullopt;
  LocalAddress address;
  std::memcpy(&address.at, found->ai_addr, found->ai_addrlen);
  address.length = found->ai_addrlen;
  ::freeaddrinfo(found);
  return address;
}

Result<void> bad_link(std::string text) {
  return tl::unexpected{Error{ErrorCode::BadConfiguration, std::move(text)}};
}

}  // namespace

std::string text_of(const LineAddress& address) {
  if (const auto* serial = std::get_if<LineSerial>(&address))
    return fmt::format("{} {} 8{}{}", serial->path, serial->baud, static_cast<char>(serial->parity),
                       serial->stop_bits);
  if (const auto* server = std::get_if<LineTcpServer>(&address))
    return fmt::format("{}:{} (TCP server)", server->host, server->port);
  if (const auto* udp = std::get_if<LineUdp>(&address))
    return fmt::format("{}:{} (UDP)", udp->host, udp->port);
  const auto& tcp = std::get<LineTcp>(address);
  return fmt::format("{}:{}", tcp.host, tcp.port);
}

Result<void> check(const LineAddress& address) {
  return std::visit(
      [](const auto& a) -> Result<void> {
        using Address = std::decay_t<decltype(a)>;
        if constexpr (std::is_same_v<Address, LineSerial>) {
          if (a.path.empty()) return bad_link("the path of the serial line is missing");
          if (!speed_of(a.baud))
            return bad_link(
                fmt::format("{} baud: the operating system knows 300, 600, 1200, 2400, "
                            "4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, "
                            "921600 and 1000000",
                            a.baud));
        } else if constexpr (std::is_same_v<Address, LineTcp>) {
          if (a.host.empty() || a.port == 0) return bad_link("host or port is missing");
        } else {
          if (!local_address(a.host, a.port))
            return bad_link(fmt::format(
                "\"{}\" is no address of a computer: use 0.0.0.0 (all networks of this computer) "
                "or the address of one of them",
                a.host));
        }
        return {};
      },
      address);
}

LineLink::LineLink(LineAddress address) : address_(std::move(address)) {
  if (const auto* tcp = std::get_if<LineTcp>(&address_)) tcp_.look_up(tcp->host, tcp->port);
}

LineLink::~LineLink() {
  close();
  close_descriptor(listener_);
}

Result<void> LineLink::open() {
  close();
  if (std::holds_alternative<LineTcp>(address_)) return tcp_.open();
  if (const auto* serial = std::get_if<LineSerial>(&address_)) return open_serial(*serial);
  if (const auto* udp = std::get_if<LineUdp>(&address_))
    return bind_socket(udp->host, udp->port, SOCK_DGRAM);
  if (listener_ >= 0) return {};
  const auto& server = std::get<LineTcpServer>(address_);
  return bind_socket(server.host, server.port, SOCK_STREAM);
}

Result<void> LineLink::bind_socket(const std::string& host, std::uint16_t port, int type) {
  const auto address = local_address(host, port);
  if (!address) return bad_link("no address of this computer: " + host);
  int fd = ::socket(address->at.ss_family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) return no_link(ErrorCode::SystemRefused, "no socket", errno);
  const int yes = 1;
  if (type == SOCK_STREAM) ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  constexpr int kBuffered = 1 << 20;  // bytes: some seconds of lines
  ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &kBuffered, sizeof kBuffered);
  const auto* at = reinterpret_cast<const sockaddr*>(&address->at);  // NOLINT: sockets interface
  if (::bind(fd, at, address->length) != 0 || (type == SOCK_STREAM && ::listen(fd, 1) != 0)) {
    const int error = errno;
    close_descriptor(fd);
    return no_link(ErrorCode::SystemRefused, "cannot receive there", error);
  }
  if (type == SOCK_STREAM) {
    listener_ = fd;
  } else {
    fd_ = fd;
    announced_ = false;
  }
  return {};
}

Result<void> LineLink::open_serial(const LineSerial& line) {
  SerialLock lock;
  ABBE_TRY(lock.take(line.path));
  int fd = ::open(line.path.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return no_link(ErrorCode::Unreachable, "open", errno);
  termios settings{};
  const auto speed = speed_of(line.baud);
  bool set = speed && ::tcgetattr(fd, &settings) == 0;
  if (set) {
    ::cfmakeraw(&settings);
    ::cfsetspeed(&settings, *speed);
    settings.c_cflag |= CLOCAL | CREAD;
    settings.c_cflag &= ~static_cast<tcflag_t>(PARENB | PARODD | CSTOPB | CRTSCTS);
    if (line.parity != Parity::None) settings.c_cflag |= PARENB;
    if (line.parity == Parity::Odd) settings.c_cflag |= PARODD;
    if (line.stop_bits == 2) settings.c_cflag |= CSTOPB;
    // Non-blocking: 0 bytes read with VMIN = 1 is EAGAIN, so that 0 means unplugged.
    settings.c_cc[VMIN] = 1;
    settings.c_cc[VTIME] = 0;
    set = ::tcsetattr(fd, TCSANOW, &settings) == 0;
  }
  if (!set) {
    const int error = errno;
    close_descriptor(fd);
    return no_link(ErrorCode::Unreachable, "configure", error);
  }
  ::tcflush(fd, TCIFLUSH);  // bytes that came before have no arrival time
  lock_ = std::move(lock);
  fd_ = fd;
  announced_ = false;
  return {};
}

void LineLink::close() noexcept {
  tcp_.close();
  close_descriptor(fd_);
  announced_ = true;
  lock_ = {};
}

bool LineLink::closed() const noexcept {
  if (std::holds_alternative<LineTcp>(address_)) return tcp_.closed();
  return fd_ < 0 && listener_ < 0;
}

bool LineLink::established() const noexcept {
  if (std::holds_alternative<LineTcp>(address_)) return tcp_.established();
  return fd_ >= 0 && announced_;
}

std::uint16_t LineLink::local_port() const noexcept {
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  const int fd = listener_ >= 0 ? listener_ : fd_;
  auto* at = reinterpret_cast<sockaddr*>(&address);  // NOLINT: sockets interface
  if (fd < 0 || ::getsockname(fd, at, &length) != 0) return 0;
  if (address.ss_family == AF_INET6)
    return ntohs(reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port);  // NOLINT
  return ntohs(reinterpret_cast<const sockaddr_in*>(&address)->sin_port);      // NOLINT
}

Result<LineLink::Ready> LineLink::wait(std::chrono::nanoseconds wall) {
  if (std::holds_alternative<LineTcp>(address_)) return tcp_.wait(wall);
  if (fd_ >= 0 && !announced_) {
    announced_ = true;
    return Ready::Established;
  }
  return wait_for_bytes(wall);
}

Result<LineLink::Ready> LineLink::wait_for_bytes(std::chrono::nanoseconds wall) {
  using std::chrono::nanoseconds;
  // poll() ignores a negative descriptor.
  std::array<pollfd, 2> waiting{{{fd_, POLLIN, 0}, {listener_, POLLIN, 0}}};
  const nanoseconds bounded = std::clamp<nanoseconds>(wall, nanoseconds{0}, kLongestLinkWait);
  const auto whole = std::chrono::floor<std::chrono::seconds>(bounded);
  const timespec timeout{whole.count(), (bounded - whole).count()};
  if (::ppoll(waiting.data(), waiting.size(), &timeout, nullptr) <= 0) return Ready::Nothing;
  if (waiting[1].revents != 0 && accept_sender()) return Ready::Established;
  return waiting[0].revents != 0 ? Ready::Readable : Ready::Nothing;
}

/// True: there is a new sender. While one is connected, others are turned away.
bool LineLink::accept_sender() {
  int accepted = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (accepted < 0) return false;
  if (fd_ >= 0) {
    close_descriptor(accepted);
    ++turned_away_;
    return false;
  }
  fd_ = accepted;
  announced_ = true;
  return true;
}

Result<LineLink::Read> LineLink::read(std::span<std::byte> into) {
  if (std::holds_alternative<LineTcp>(address_)) {
    const auto count = tcp_.read(into);
    ABBE_TRY(count);
    return Read{*count, false};
  }
  ssize_t n = 0;
  if (std::holds_alternative<LineSerial>(address_))
    n = ::read(fd_, into.data(), into.size());
  else
    n = ::recv(fd_, into.data(), into.size(), MSG_DONTWAIT | (datagrams() ? MSG_TRUNC : 0));
  if (n < 0 && nothing_yet(errno)) return Read{};
  if (n < 0) return no_link(ErrorCode::Unreachable, "connection lost", errno);
  if (n == 0 && !datagrams())
    return tl::unexpected{Error{ErrorCode::Unreachable, "connection closed by the peer"}};
  const auto received = static_cast<std::size_t>(n);
  return Read{std::min(received, into.size()), received > into.size()};
}

}  // namespace abbe::drivers
