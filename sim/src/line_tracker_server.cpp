#include "abbe/sim/line_tracker_server.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <span>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::sim {
namespace {

/// With every datagram below the usual size of an Ethernet frame none is fragmented.
constexpr std::size_t kDatagram = 1400;
/// A receiver with more unsent bytes has stopped reading.
constexpr std::size_t kMostUnsentLines = 8u << 20;
constexpr std::chrono::milliseconds kTryAgain{200};

bool gone(const Socket& peer) {
  std::array<char, 256> bytes;  // NOLINT: what a receiver sends is ignored
  for (;;) {
    const ssize_t n = ::recv(peer.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (n > 0) continue;
    return n == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
  }
}

}  // namespace

template <class Source>
Result<LineServer<Source>> LineServer<Source>::open(const LineOutput& output,
                                                    std::unique_ptr<Source> tracker, HostTime now) {
  LineServer server{output, std::move(tracker)};
  server.port_ = output.port;
  if (output.transport == LineTransport::Tcp) {
    auto listener = listen_tcp(output.port);
    ABBE_TRY(listener);
    server.listener_ = std::move(*listener);
    server.port_ = port_of(server.listener_);
  } else if (output.transport == LineTransport::Serial) {
    auto terminal = PseudoTerminal::open(output.link);
    ABBE_TRY(terminal);
    server.terminal_ = std::move(*terminal);
    server.tracker_->connected(now);
  }
  return server;
}

template <class Source>
std::string LineServer<Source>::where() const {
  switch (output_.transport) {
    case LineTransport::Tcp:
      return fmt::format("lines on 127.0.0.1:{}", port_);
    case LineTransport::TcpServer:
      return fmt::format("lines to 127.0.0.1:{}", port_);
    case LineTransport::Udp:
      return fmt::format("lines to 127.0.0.1:{} (UDP)", port_);
    case LineTransport::Serial:
      break;
  }
  return fmt::format("lines on {}", output_.link);
}

template <class Source>
void LineServer<Source>::poll(HostTime now) {
  if (tracker_->take_hang_up()) lose(now);
  if (!receiver_) find_receiver(now);
  if (receiver_ && output_.transport != LineTransport::Udp && gone(receiver_)) lose(now);
  tracker_->advance(now);
  send(now);
}

template <class Source>
void LineServer<Source>::find_receiver(HostTime now) {
  if (output_.transport == LineTransport::Tcp) {
    Socket accepted(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!accepted) return;
    const int on = 1;
    ::setsockopt(accepted.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    receiver_ = std::move(accepted);
    tracker_->connected(now);
  } else if (output_.transport != LineTransport::Serial && now >= connect_at_) {
    connect(now, output_.transport == LineTransport::Udp ? SOCK_DGRAM : SOCK_STREAM);
  }
}

template <class Source>
void LineServer<Source>::connect(HostTime now, int type) {
  connect_at_ = now + kTryAgain;
  Socket socket(::socket(AF_INET, type | SOCK_CLOEXEC, 0));
  const auto at = loopback_address(output_.port);
  const auto* address = reinterpret_cast<const sockaddr*>(&at);  // NOLINT: sockets interface
  if (::connect(socket.get(), address, sizeof(sockaddr_in)) != 0) return;
  receiver_ = std::move(socket);
  tracker_->connected(now);
}

template <class Source>
void LineServer<Source>::lose(HostTime now) {
  receiver_.close();
  unsent_.clear();
  connect_at_ = now + kTryAgain;
  if (output_.transport != LineTransport::Serial) tracker_->disconnected();
}

template <class Source>
void LineServer<Source>::send(HostTime now) {
  const std::string text = tracker_->take_output();
  const auto bytes = std::as_bytes(std::span{text});
  switch (output_.transport) {
    case LineTransport::Serial:
      // Lines that are not read are lost, as on a real line.
      if (!text.empty()) static_cast<void>(::write(terminal_.fd(), text.data(), text.size()) < 0);
      return;
    case LineTransport::Udp:
      for (std::string_view rest = text; receiver_ && !rest.empty();) {
        const std::size_t end =
            rest.size() <= kDatagram ? rest.size() : rest.rfind('\n', kDatagram - 1) + 1;
        // No program has bound the port: the kernel reports it with the next datagram.
        if (::send(receiver_.get(), rest.data(), end, MSG_DONTWAIT | MSG_NOSIGNAL) < 0 &&
            errno == ECONNREFUSED)
          return lose(now);
        rest.remove_prefix(end);
      }
      return;
    case LineTransport::Tcp:
    case LineTransport::TcpServer:
      break;
  }
  if (!receiver_) return;
  unsent_.insert(unsent_.end(), bytes.begin(), bytes.end());
  send_what_fits(receiver_, unsent_);
  if (unsent_.size() > kMostUnsentLines) lose(now);
}

template <class Source>
HostTime LineServer<Source>::next_due() const {
  const bool connects = !receiver_ && (output_.transport == LineTransport::TcpServer ||
                                       output_.transport == LineTransport::Udp);
  return connects ? std::min(connect_at_, tracker_->next_due()) : tracker_->next_due();
}

template <class Source>
void LineServer<Source>::add_poll_fds(std::vector<pollfd>& fds) const {
  if (listener_ && !receiver_) fds.push_back({listener_.get(), POLLIN, 0});
  if (receiver_) add_client_fd(receiver_.get(), !unsent_.empty(), fds);
}

template class LineServer<LineAxes>;
template class LineServer<LineTracker>;
template class LineServer<RecordedLines>;

}  // namespace abbe::sim
