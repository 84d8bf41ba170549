#pragma once
/// Encoder nodes on a UDP socket of 127.0.0.1, in the test's own thread: what the device under test
/// talks to.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <span>

#include "abbe/protocol/can/udp_framing.hpp"
#include "encoder_nodes.hpp"

namespace abbe::tests {

class EncoderPeer : public EncoderNodes {
 public:
  explicit EncoderPeer(std::span<const can::EncoderIdentity> identities)
      : EncoderNodes(identities) {
    fd_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    socklen_t size = sizeof address;
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  ~EncoderPeer() override { ::close(fd_); }

  [[nodiscard]] std::uint16_t port() const { return port_; }

  /// Whom to send to before anything came from there.
  void talk_to(std::uint16_t port) {
    to_.sin_family = AF_INET;
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to_.sin_port = htons(port);
  }
  /// Every frame that ever came.
  [[nodiscard]] std::size_t frames_received() const { return frames_received_; }

  /// Reads what came; answers SDO and NMT, beats. A SYNC is only remembered: see answer_sync().
  void serve(HostTime now) {
    std::array<std::byte, 65536> buffer{};
    while (true) {
      socklen_t size = sizeof to_;
      const auto n = ::recvfrom(fd_, buffer.data(), buffer.size(), 0,
                                reinterpret_cast<sockaddr*>(&to_), &size);
      if (n < 0) break;
      auto view = can::DatagramView::parse(std::span{buffer}.first(static_cast<std::size_t>(n)));
      ASSERT_TRUE(view.has_value()) << "the device sent no CAN datagram";
      can::CanFrame frame;
      for (; view->next(frame); ++frames_received_) on_frame(frame, now);
    }
    beat(now);
  }
  /// Lets the operating system wait until something comes, at most `ms`.
  void wait(int ms) const {
    pollfd p{fd_, POLLIN, 0};
    ::poll(&p, 1, ms);
  }
  /// Discards everything received: the cable was unplugged.
  void drain() {
    std::array<std::byte, 65536> buffer{};
    while (::recv(fd_, buffer.data(), buffer.size(), 0) >= 0) {
    }
    forget_sync();
  }
  /// Power off and on.
  void restart() {
    sequence_ = 0;
    EncoderNodes::restart();
  }
  void send(std::span<const can::CanFrame> frames) override {
    std::array<std::byte, 65000> buffer{};
    can::DatagramWriter writer{buffer, sequence_++};
    for (const auto& frame : frames) EXPECT_TRUE(writer.add(frame));
    send_bytes(writer.finish());
  }
  void send_bytes(std::span<const std::byte> bytes) {
    if (to_.sin_port == 0) return;
    ::sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to_),
             sizeof to_);
  }
  void skip_sequence(unsigned n) { sequence_ = static_cast<std::uint8_t>(sequence_ + n); }

 private:
  int fd_ = -1;
  std::uint16_t port_ = 0;
  sockaddr_in to_{};
  std::size_t frames_received_ = 0;
  std::uint8_t sequence_ = 0;
};

}  // namespace abbe::tests
