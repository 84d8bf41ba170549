#include "abbe/protocol/can/canopen.hpp"

#include <algorithm>

#include "can/little_endian.hpp"

namespace abbe::protocol::can {

namespace {

/// The node of a frame with the identifier base + node; nullopt if the identifier is not in
/// base + 1 to base + 127, or if it is not a standard data frame.
std::optional<NodeId> node_of(const CanFrame& frame, std::uint32_t base) noexcept {
  if (!frame.is_standard_data() || frame.id <= base || frame.id > base + kMaxNodeId)
    return std::nullopt;
  return static_cast<NodeId>(frame.id - base);
}

bool is_known(NmtCommand command) noexcept {
  switch (command) {
    case NmtCommand::Start:
    case NmtCommand::Stop:
    case NmtCommand::PreOperational:
    case NmtCommand::ResetNode:
    case NmtCommand::ResetCommunication:
      return true;
  }
  return false;
}

bool is_known(NodeState state) noexcept {
  switch (state) {
    case NodeState::BootUp:
    case NodeState::Stopped:
    case NodeState::Operational:
    case NodeState::PreOperational:
      return true;
  }
  return false;
}

}  // namespace

CanFrame encode_nmt(NmtCommand command, NodeId node) ABBE_RT {
  return standard_frame(cob::kNmt, {static_cast<std::uint8_t>(command), node});
}

std::optional<NmtMessage> decode_nmt(const CanFrame& frame) ABBE_RT {
  if (!frame.is_standard_data() || frame.id != cob::kNmt || frame.length != 2) return std::nullopt;
  const NmtMessage message{static_cast<NmtCommand>(frame.byte(0)), frame.byte(1)};
  if (!is_known(message.command) || message.node > kMaxNodeId) return std::nullopt;
  return message;
}

CanFrame encode_sync(std::optional<std::uint8_t> counter) ABBE_RT {
  auto frame = standard_frame(cob::kSync, std::span<const std::byte>{});
  if (counter) {
    frame.length = 1;
    frame.data[0] = std::byte{*counter};
  }
  return frame;
}

std::optional<Sync> decode_sync(const CanFrame& frame) ABBE_RT {
  if (!frame.is_standard_data() || frame.id != cob::kSync || frame.length > 1) return std::nullopt;
  if (frame.length == 0) return Sync{};
  return Sync{frame.byte(0)};
}

CanFrame encode_heartbeat(NodeId node, NodeState state) ABBE_RT {
  return standard_frame(cob::kHeartbeat + node, {static_cast<std::uint8_t>(state)});
}

std::optional<Heartbeat> decode_heartbeat(const CanFrame& frame) ABBE_RT {
  const auto node = node_of(frame, cob::kHeartbeat);
  const auto state = static_cast<NodeState>(frame.byte(0));
  if (!node || frame.length != 1 || !is_known(state)) return std::nullopt;
  return Heartbeat{*node, state};
}

CanFrame encode_emergency(const Emergency& emergency) ABBE_RT {
  auto frame = standard_frame(cob::kEmergency + emergency.node, std::span<const std::byte>{});
  frame.length = 8;
  store_le(std::span{frame.data}, 0, emergency.code);
  frame.data[2] = std::byte{emergency.error_register};
  std::copy(emergency.manufacturer.begin(), emergency.manufacturer.end(), frame.data.begin() + 3);
  return frame;
}

std::optional<Emergency> decode_emergency(const CanFrame& frame) ABBE_RT {
  const auto node = node_of(frame, cob::kEmergency);
  if (!node || frame.length != 8) return std::nullopt;
  Emergency emergency{*node, load_le<std::uint16_t>(frame.data), frame.byte(2), {}};
  std::copy_n(frame.data.begin() + 3, emergency.manufacturer.size(),
              emergency.manufacturer.begin());
  return emergency;
}

}  // namespace abbe::protocol::can
