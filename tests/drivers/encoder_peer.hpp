#pragma once
/// Encoder nodes on a UDP socket of 127.0.0.1, in the test's own thread: what the device under test talks to.
/// Built from the server side of the protocol room; nothing happens but in serve() and the functions a test
/// calls.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "abbe/protocol/can/object_dictionary.hpp"
#include "abbe/protocol/can/sdo_server.hpp"
#include "abbe/protocol/can/udp_framing.hpp"

namespace abbe::tests {

namespace can = protocol::can;
using protocol::HostTime;

struct PeerNode {
  explicit PeerNode(const can::EncoderIdentity& identity)
      : objects(identity), server(identity.node, objects), id(identity.node) {}
  can::ObjectDictionary objects;
  can::SdoServer server;
  can::NodeId id;
  can::NodeState state = can::NodeState::PreOperational;
  std::optional<HostTime> last_heartbeat;
  bool mute = false;         ///< says nothing at all
  bool no_position = false;  ///< answers SDO, sends no TPDO
};

class EncoderPeer {
 public:
  explicit EncoderPeer(std::span<const can::EncoderIdentity> identities) {
    for (const auto& identity : identities) nodes_.emplace_back(identity);
    fd_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    socklen_t size = sizeof address;
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  EncoderPeer(const EncoderPeer&) = delete;
  EncoderPeer& operator=(const EncoderPeer&) = delete;
  ~EncoderPeer() { ::close(fd_); }

  [[nodiscard]] std::uint16_t port() const { return port_; }
  PeerNode& node(std::size_t i) { return nodes_[i]; }
  [[nodiscard]] std::size_t syncs() const { return syncs_; }
  [[nodiscard]] const std::vector<can::NmtMessage>& nmt() const { return nmt_; }

  /// Reads what came; answers SDO and NMT, beats. A SYNC is only remembered: see answer_sync().
  void serve(HostTime now) {
    std::array<std::byte, 65536> buffer{};
    while (true) {
      socklen_t size = sizeof to_;
      const auto n =
          ::recvfrom(fd_, buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&to_), &size);
      if (n < 0) break;
      auto view = can::DatagramView::parse(std::span{buffer}.first(static_cast<std::size_t>(n)));
      ASSERT_TRUE(view.has_value()) << "the device sent no CAN datagram";
      can::CanFrame frame;
      while (view->next(frame)) on_frame(frame, now);
    }
    beat(now);
  }
  /// Lets the operating system wait until something comes, at most `ms`.
  void wait(int ms) const {
    pollfd p{fd_, POLLIN, 0};
    ::poll(&p, 1, ms);
  }
  /// Forgets everything that came: the cable was out.
  void drain() {
    std::array<std::byte, 65536> buffer{};
    while (::recv(fd_, buffer.data(), buffer.size(), 0) >= 0) {
    }
    sync_waiting_ = false;
  }
  /// The TPDOs of the last SYNC, if one is waiting.
  [[nodiscard]] std::vector<can::CanFrame> take_answer() {
    std::vector<can::CanFrame> frames;
    if (!sync_waiting_) return frames;
    sync_waiting_ = false;
    for (auto& node : nodes_) {
      if (node.state != can::NodeState::Operational || node.mute || node.no_position) continue;
      for (const unsigned number : {1u, 2u}) {
        const auto pdo = node.objects.tpdo(number);
        if (pdo.enabled && pdo.transmission_type == 1) frames.push_back(node.objects.tpdo_frame(number));
      }
    }
    return frames;
  }
  void answer_sync() {
    if (const auto frames = take_answer(); !frames.empty()) send(frames);
  }
  void move_to(std::int64_t count) {
    for (auto& node : nodes_) node.objects.set_raw_position(count);
  }
  /// Power off and on.
  void restart() {
    sequence_ = 0;
    sync_waiting_ = false;
    std::vector<can::CanFrame> boot_ups;
    for (auto& node : nodes_) {
      node.objects.reset();
      boot(node, boot_ups);
    }
    send(boot_ups);
  }
  void send(std::span<const can::CanFrame> frames) {
    std::array<std::byte, 65000> buffer{};
    can::DatagramWriter writer{buffer, sequence_++};
    for (const auto& frame : frames) EXPECT_TRUE(writer.add(frame));
    send_bytes(writer.finish());
  }
  void send_bytes(std::span<const std::byte> bytes) {
    if (to_.sin_port == 0) return;
    ::sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
  }
  void skip_sequence(unsigned n) { sequence_ = static_cast<std::uint8_t>(sequence_ + n); }

 private:
  void on_frame(const can::CanFrame& frame, HostTime now) {
    std::vector<can::CanFrame> answers;
    if (can::decode_sync(frame)) {
      sync_waiting_ = true;
      ++syncs_;
    }
    if (const auto message = can::decode_nmt(frame)) {
      nmt_.push_back(*message);
      for (auto& node : nodes_) {
        if (message->node == can::kAllNodes || message->node == node.id)
          on_nmt(node, message->command, answers);
      }
    }
    for (auto& node : nodes_) {
      if (node.mute) continue;
      if (const auto answer = node.server.on_frame(frame, now)) answers.push_back(*answer);
    }
    if (!answers.empty()) send(answers);
  }
  static void boot(PeerNode& node, std::vector<can::CanFrame>& out) {
    node.state = can::NodeState::PreOperational;
    node.last_heartbeat.reset();
    if (!node.mute) out.push_back(can::encode_heartbeat(node.id, can::NodeState::BootUp));
  }
  static void on_nmt(PeerNode& node, can::NmtCommand command, std::vector<can::CanFrame>& out) {
    switch (command) {
      case can::NmtCommand::Start:
        node.state = can::NodeState::Operational;
        break;
      case can::NmtCommand::Stop:
        node.state = can::NodeState::Stopped;
        break;
      case can::NmtCommand::PreOperational:
        node.state = can::NodeState::PreOperational;
        break;
      case can::NmtCommand::ResetNode:
      case can::NmtCommand::ResetCommunication:
        node.objects.reset();
        boot(node, out);
        break;
    }
  }
  void beat(HostTime now) {
    for (auto& node : nodes_) {
      const std::chrono::milliseconds period{node.objects.number(can::object::kHeartbeatTime).value_or(0)};
      if (node.mute || period.count() == 0) continue;
      if (node.last_heartbeat && now - *node.last_heartbeat < period) continue;
      node.last_heartbeat = now;
      const std::array frames{can::encode_heartbeat(node.id, node.state)};
      send(frames);
    }
  }

  std::deque<PeerNode> nodes_;  // a deque: a node's server holds on to its dictionary
  int fd_ = -1;
  std::uint16_t port_ = 0;
  sockaddr_in to_{};
  std::uint8_t sequence_ = 0;
  bool sync_waiting_ = false;
  std::size_t syncs_ = 0;
  std::vector<can::NmtMessage> nmt_;
};

}  // namespace abbe::tests
