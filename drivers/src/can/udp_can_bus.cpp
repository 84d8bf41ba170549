#include "abbe/drivers/can/udp_can_bus.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <unistd.h>

#include <memory>

#include "abbe/result/try.hpp"
#include "can/socket_io.hpp"

namespace abbe::drivers {

using protocol::HostTime;

namespace {

/// UDP payload of an Ethernet frame: a larger datagram would be split into IP fragments, each of
/// which can be lost.
constexpr std::size_t kDatagramBytes = 1472;

/// Address and port of the peer. An address literal needs no look-up; the look-up of a name can
/// block for seconds.
Result<sockaddr_in> resolve(const std::string& host, std::uint16_t port) {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host.c_str(), nullptr, &hints, &found);

  if (error != 0) {
    return tl::unexpected(Error{ErrorCode::Unreachable, fmt::format("CAN udp {}: no address: {}",
                                                                    host, ::gai_strerror(error))});
  }

  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner{found, &::freeaddrinfo};
  sockaddr_in address{};
  std::memcpy(&address, found->ai_addr, sizeof address);
  address.sin_port = htons(port);

  return address;
}

}  // namespace

UdpCanBus::UdpCanBus(UdpCanOptions options, const TimeSource& time)
    : options_(std::move(options)), time_(time), stamps_(options_.speed) {}

UdpCanBus::~UdpCanBus() {
  close();
}

std::string UdpCanBus::name() const {
  return fmt::format("udp {}:{}", options_.peer_address, options_.peer_port);
}

CanBusCounters UdpCanBus::counters() const noexcept {
  return {gaps_.lost(), refused_, stamps_.widened(), strangers_};
}

void UdpCanBus::close() noexcept {
  for (int* fd : {&fd_, &stranger_fd_}) {
    if (*fd >= 0) ::close(*fd);
    *fd = -1;
  }
  bound_port_ = 0;
  rest_.reset();
}

Result<void> UdpCanBus::open(std::span<const std::uint32_t> ids) {
  close();
  gaps_.restart();
  wanted_.reset();
  for (const auto id : ids) wanted_.set(id & can::CanFrame::kStandardMask);

  if (options_.peer_address.empty() || options_.peer_port == 0) {
    return tl::unexpected(
        Error{ErrorCode::BadConfiguration, fmt::format("CAN {}: host or port is missing", name())});
  }

  const auto local = resolve(options_.local_address, options_.local_port);
  ABBE_TRY(local);
  const auto peer = resolve(options_.peer_address, options_.peer_port);
  ABBE_TRY(peer);
  stamps_.nothing_older_than(read_clock_pair());

  return bind_and_connect(*local, *peer);
}

/// The port is bound without SO_REUSEPORT first, so that a port in use is refused; then a second
/// socket of ours shares it. After connect() the kernel delivers the peer's datagrams to the first
/// socket and all others to the second: a flood of foreign datagrams cannot fill the peer's receive
/// queue.
Result<void> UdpCanBus::bind_and_connect(const sockaddr_in& local, const sockaddr_in& peer) {
  const auto no = [this](std::string_view what) {
    const auto error = errno;
    close();
    return socket_error(ErrorCode::SystemRefused, name(), what, error);
  };

  peer_ = peer;
  fd_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) return no("socket");
  enable_stamps(fd_);

  // NOLINT: the sockets interface
  const auto* local_any = reinterpret_cast<const sockaddr*>(&local);
  if (bind(fd_, local_any, sizeof local) != 0)
    return no(fmt::format("bind {}:{}", options_.local_address, options_.local_port));
  sockaddr_in bound{};
  socklen_t length = sizeof bound;
  getsockname(fd_, reinterpret_cast<sockaddr*>(&bound), &length);  // NOLINT: the sockets interface
  bound_port_ = ntohs(bound.sin_port);
  listen_for_strangers(bound);

  // NOLINT: the sockets interface
  const auto* peer_any = reinterpret_cast<const sockaddr*>(&peer_);
  if (connect(fd_, peer_any, sizeof peer_) != 0) return no("connect");
  return {};
}

/// Opens the second socket, which counts the datagrams of senders other than the peer. If this
/// fails, these datagrams are still refused, but not counted.
void UdpCanBus::listen_for_strangers(sockaddr_in local) {
  const int on = 1;
  setsockopt(fd_, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on);
  stranger_fd_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (stranger_fd_ < 0) return;
  setsockopt(stranger_fd_, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on);
  const auto* any = reinterpret_cast<const sockaddr*>(&local);  // NOLINT: the sockets interface
  if (bind(stranger_fd_, any, sizeof local) == 0) return;
  ::close(stranger_fd_);
  stranger_fd_ = -1;
}

bool UdpCanBus::is_peer(const sockaddr_in& from) const {
  return from.sin_addr.s_addr == peer_.sin_addr.s_addr && from.sin_port == peer_.sin_port;
}

void UdpCanBus::count_stranger(const sockaddr_in& from) {
  std::array<char, INET_ADDRSTRLEN> text{};
  ::inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size());
  ++strangers_;
  stranger_ = fmt::format("{}:{}", text.data(), ntohs(from.sin_port));
}

void UdpCanBus::count_strangers() {
  constexpr unsigned kMostAtOnce = 64;
  if (stranger_fd_ < 0) return;
  for (unsigned i = 0; i < kMostAtOnce; ++i) {
    sockaddr_in from{};
    socklen_t size = sizeof from;
    auto* any = reinterpret_cast<sockaddr*>(&from);  // NOLINT: the sockets interface
    if (::recvfrom(stranger_fd_, nullptr, 0, MSG_DONTWAIT, any, &size) < 0) return;
    // A datagram that the peer sent before connect() arrives here and is lost; it does not count as
    // refused.
    if (!is_peer(from)) count_stranger(from);
  }
}

Result<CanRead> UdpCanBus::read(std::span<ReceivedFrame> out, std::chrono::nanoseconds wall) {
  CanRead read{.frames = take_frames(out)};
  if (read.frames == 0) wait_readable(fd_, wall);
  count_strangers();
  read.until = time_.now();
  const auto begun = read_clock_pair();

  while (read.frames < out.size()) {
    const auto next = receive_datagram();
    if (!next && read.frames == 0) return tl::unexpected(next.error());
    read.all = next && *next == Next::Nothing;
    if (read.all) stamps_.nothing_older_than(begun);
    if (!next || *next != Next::Datagram) break;
    read.frames += take_frames(out.subspan(read.frames));
  }

  return read;
}

/// Reads the next datagram into the buffer. A datagram without valid CAN frames is counted and
/// skipped. Returns Next::Unknown at the limit of skipped datagrams: more datagrams may be queued.
Result<UdpCanBus::Next> UdpCanBus::receive_datagram() {
  for (unsigned skipped = 0; skipped < 64; ++skipped) {  // bounded, also in a flood of them
    iovec io{buffer_.data(), buffer_.size()};
    alignas(cmsghdr) std::array<char, 256> control{};
    sockaddr_in from{};
    msghdr message{};
    message.msg_name = &from;
    message.msg_namelen = sizeof from;
    message.msg_iov = &io;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const auto size = recvmsg(fd_, &message, MSG_DONTWAIT);
    if (size < 0) {
      if (errno == EAGAIN || errno == EWOULDBLOCK) return Next::Nothing;
      if (errno == EINTR) return Next::Unknown;
      const auto code = errno == ECONNREFUSED ? ErrorCode::Unreachable : ErrorCode::SystemRefused;
      return socket_error(code, name(), "receive", errno);
    }
    if (!is_peer(from)) {  // it arrived before connect()
      count_stranger(from);
      continue;
    }
    rest_arrival_ = {.time = time_.now()};
    if (options_.speed > 0.0) {
      const auto clocks = read_clock_pair();
      rest_arrival_ =
          stamps_.arrival(stamp_of(message), clocks, HostTime{time_.host(clocks.monotonic)});
    }
    auto view = can::DatagramView::parse(std::span{buffer_}.first(static_cast<std::size_t>(size)));
    if (view) {
      gaps_.on_sequence(view->sequence());
      rest_ = *view;
      return Next::Datagram;
    }
    ++refused_;
  }

  return Next::Unknown;
}

std::size_t UdpCanBus::take_frames(std::span<ReceivedFrame> out) {
  std::size_t count = 0;
  if (!rest_) return 0;
  while (count < out.size()) {
    auto& slot = out[count];
    if (!rest_->next(slot.frame)) {
      rest_.reset();
      break;
    }
    slot.time = rest_arrival_.time;
    slot.time_widened = rest_arrival_.widened;
    slot.echo = false;
    const bool wanted = slot.frame.is_standard_data() && wanted_.test(slot.frame.id);
    if (wanted || slot.frame.is(can::FrameFlag::Error)) ++count;
  }

  return count;
}

Result<void> UdpCanBus::send(std::span<const can::CanFrame> frames) {
  std::array<std::byte, kDatagramBytes> buffer;  // NOLINT: filled by the writer
  while (!frames.empty()) {
    can::DatagramWriter writer{buffer, sequence_++};
    std::size_t n = 0;
    while (n < frames.size() && writer.add(frames[n])) ++n;
    ABBE_TRY(send_datagram(writer.finish()));
    frames = frames.subspan(n);
  }
  return {};
}

Result<void> UdpCanBus::send_datagram(std::span<const std::byte> datagram) {
  if (::send(fd_, datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return {};
  const bool passing = errno == ECONNREFUSED || errno == EAGAIN || errno == ENOBUFS ||
                       errno == ENETUNREACH || errno == EHOSTUNREACH;
  return socket_error(passing ? ErrorCode::Unreachable : ErrorCode::SystemRefused, name(), "send",
                      errno);
}

}  // namespace abbe::drivers
