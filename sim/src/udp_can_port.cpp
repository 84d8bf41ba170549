#include <netinet/in.h>

#include <array>
#include <utility>

#include "abbe/protocol/can/udp_framing.hpp"
#include "abbe/result/try.hpp"
#include "can_port.hpp"

namespace abbe::sim {
namespace {

constexpr std::size_t kLargestDatagram = 65536;
// Largest datagram sent, bytes: below every Ethernet MTU; the default of cannelloni.
constexpr std::size_t kOutgoingDatagram = 1400;
constexpr int kMostDatagrams = 256;

class UdpCanPort final : public CanPort {
 public:
  UdpCanPort(Socket socket, const CanPortOptions& options)
      : socket_(std::move(socket)),
        age_(socket_, options.speed),
        port_(port_of(socket_)),
        buffer_(kLargestDatagram) {
    if (options.peer_port == 0) return;
    peer_ = loopback_address(options.peer_port);
    has_peer_ = true;
  }

  std::span<const ArrivedFrame> receive() override {
    arrived_.clear();
    for (int i = 0; i < kMostDatagrams && receive_datagram(); ++i) {
    }
    return arrived_;
  }

  void send(std::span<const can::CanFrame> frames) override {
    std::array<std::byte, kOutgoingDatagram> buffer;  // NOLINT: filled by the writer
    while (has_peer_ && !frames.empty()) {
      can::DatagramWriter writer(buffer, sequence_++);
      while (!frames.empty() && writer.add(frames.front())) frames = frames.subspan(1);
      send_bytes(writer.finish());
    }
  }

  void send_garbage() override {
    constexpr std::array<std::byte, 7> kNoDatagram{
        std::byte{0xff}, std::byte{0xff}, std::byte{0x00}, std::byte{0x13},
        std::byte{0x37}, std::byte{0x02}, std::byte{0x00}};
    if (has_peer_) send_bytes(kNoDatagram);
  }

  [[nodiscard]] bool has_listener() const override { return has_peer_; }
  [[nodiscard]] int fd() const override { return socket_.get(); }
  [[nodiscard]] std::uint16_t port() const override { return port_; }

 private:
  bool receive_datagram() {
    sockaddr_storage from{};
    iovec part{buffer_.data(), buffer_.size()};
    alignas(cmsghdr) std::array<char, 64> control{};
    msghdr message{};
    message.msg_name = &from;
    message.msg_namelen = sizeof from;
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = ::recvmsg(socket_.get(), &message, MSG_DONTWAIT);
    if (size < 0) return false;
    peer_ = from;
    has_peer_ = true;
    const auto age = age_.of(message);
    auto view = can::DatagramView::parse(std::span(buffer_).first(static_cast<std::size_t>(size)));
    if (!view) return true;  // not a cannelloni datagram: ignored
    for (can::CanFrame frame; view->next(frame);) arrived_.push_back({frame, age});

    return true;
  }
  void send_bytes(std::span<const std::byte> bytes) {
    ::sendto(socket_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
             reinterpret_cast<const sockaddr*>(&peer_), sizeof(sockaddr_in));
  }

  Socket socket_;
  MessageAge age_;
  std::uint16_t port_;
  bool has_peer_ = false;
  sockaddr_storage peer_{};
  std::uint8_t sequence_ = 0;
  std::vector<std::byte> buffer_;
  std::vector<ArrivedFrame> arrived_;
};

}  // namespace

Result<std::unique_ptr<CanPort>> open_udp_port(const CanPortOptions& options) {
  auto socket = bind_udp(options.port);
  ABBE_TRY(socket);
  return std::make_unique<UdpCanPort>(std::move(*socket), options);
}

}  // namespace abbe::sim
