#pragma once
/// Encoder nodes on the thread of the test, built from the server side of the module protocol: the
/// peer of an encoder device under test. They act only in the functions that a test calls. The
/// derived class transports the frames.

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "abbe/protocol/can/object_dictionary.hpp"
#include "abbe/protocol/can/sdo_server.hpp"

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
  bool mute = false;         ///< sends nothing
  bool no_position = false;  ///< answers SDO, sends no TPDO
  /// Writing this object is refused with this abort code.
  std::optional<std::pair<can::ObjectId, can::AbortCode>> refuses;

  [[nodiscard]] std::optional<can::CanFrame> answer(const can::CanFrame& frame, HostTime now) {
    const bool download = frame.is_standard_data() && frame.id == can::cob::kSdoRequest + id &&
                          frame.byte(0) >> 5 == 1;
    const auto low = frame.byte(1), high = frame.byte(2), sub = frame.byte(3);
    const can::ObjectId object{static_cast<std::uint16_t>(low | high << 8), sub};
    if (!download || !refuses || refuses->first != object) return server.on_frame(frame, now);
    const auto code = static_cast<std::uint32_t>(refuses->second);
    const auto byte = [code](unsigned shift) { return static_cast<std::uint8_t>(code >> shift); };
    return can::standard_frame(can::cob::kSdoResponse + id,
                               {0x80, low, high, sub, byte(0), byte(8), byte(16), byte(24)});
  }
};

class EncoderNodes {
 public:
  explicit EncoderNodes(std::span<const can::EncoderIdentity> identities) {
    for (const auto& identity : identities) nodes_.emplace_back(identity);
  }
  EncoderNodes(const EncoderNodes&) = delete;
  EncoderNodes& operator=(const EncoderNodes&) = delete;
  virtual ~EncoderNodes() = default;

  virtual void send(std::span<const can::CanFrame> frames) = 0;

  PeerNode& node(std::size_t i) { return nodes_[i]; }
  [[nodiscard]] std::size_t syncs() const { return syncs_; }
  [[nodiscard]] const std::vector<can::NmtMessage>& nmt() const { return nmt_; }

  /// The TPDOs of the last SYNC, if one is waiting.
  [[nodiscard]] std::vector<can::CanFrame> take_answer() {
    std::vector<can::CanFrame> frames;
    if (!sync_waiting_) return frames;
    sync_waiting_ = false;
    for (auto& node : nodes_) {
      if (node.state != can::NodeState::Operational || node.mute || node.no_position) continue;
      for (const unsigned number : {1u, 2u}) {
        const auto pdo = node.objects.tpdo(number);
        if (pdo.enabled && pdo.transmission_type == 1)
          frames.push_back(node.objects.tpdo_frame(number));
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
    sync_waiting_ = false;
    std::vector<can::CanFrame> boot_ups;
    for (auto& node : nodes_) {
      node.objects.reset();
      boot(node, boot_ups);
    }
    send(boot_ups);
  }

 protected:
  void forget_sync() { sync_waiting_ = false; }
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
      if (const auto answer = node.answer(frame, now)) answers.push_back(*answer);
    }

    if (!answers.empty()) send(answers);
  }
  void beat(HostTime now) {
    for (auto& node : nodes_) {
      const std::chrono::milliseconds period{
          node.objects.number(can::object::kHeartbeatTime).value_or(0)};
      if (node.mute || period.count() == 0) continue;
      if (node.last_heartbeat && now - *node.last_heartbeat < period) continue;
      node.last_heartbeat = now;
      const std::array frames{can::encode_heartbeat(node.id, node.state)};
      send(frames);
    }
  }

 private:
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

  std::deque<PeerNode> nodes_;  // a deque: a node's server refers to its dictionary
  bool sync_waiting_ = false;
  std::size_t syncs_ = 0;
  std::vector<can::NmtMessage> nmt_;
};

}  // namespace abbe::tests
