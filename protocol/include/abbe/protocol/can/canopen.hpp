#pragma once
/// CANopen communication objects of one frame each: NMT, SYNC, heartbeat, EMCY [CiA 301]. The
/// decoders accept any frame; they return nullopt if it is not exactly such an object. Pure, no
/// allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::can {

using NodeId = std::uint8_t;  ///< 1..127; 0 addresses all nodes in NMT commands only
inline constexpr NodeId kMaxNodeId = 127;
inline constexpr NodeId kAllNodes = 0;
[[nodiscard]] constexpr bool is_node_id(unsigned node) noexcept {
  return node >= 1 && node <= kMaxNodeId;
}

/// Identifiers of the predefined connection set [CiA 301].
namespace cob {
inline constexpr std::uint32_t kNmt = 0x000;
inline constexpr std::uint32_t kSync = 0x080;
inline constexpr std::uint32_t kEmergency = 0x080;    ///< + node
inline constexpr std::uint32_t kTpdo1 = 0x180;        ///< + node; TPDO n: + 100h (n - 1)
inline constexpr std::uint32_t kSdoResponse = 0x580;  ///< + node, server -> client
inline constexpr std::uint32_t kSdoRequest = 0x600;   ///< + node, client -> server
inline constexpr std::uint32_t kHeartbeat = 0x700;    ///< + node
[[nodiscard]] constexpr std::uint32_t tpdo(unsigned number, NodeId node) noexcept {
  return kTpdo1 + 0x100 * (number - 1) + node;
}
/// TPDO 1 to 4 of any node.
[[nodiscard]] constexpr bool is_tpdo(const CanFrame& frame) noexcept {
  constexpr std::uint32_t kFromNode = 0x80;  // bit of a TPDO; 0 in an RPDO
  return frame.is_standard_data() && frame.id > kTpdo1 && frame.id < kSdoResponse &&
         (frame.id & kFromNode) != 0;
}
}  // namespace cob

enum class NmtCommand : std::uint8_t {
  Start = 1,
  Stop = 2,
  PreOperational = 128,
  ResetNode = 129,
  ResetCommunication = 130
};
struct NmtMessage {
  NmtCommand command{};
  NodeId node = kAllNodes;
};
[[nodiscard]] CanFrame encode_nmt(NmtCommand command, NodeId node) ABBE_RT;
[[nodiscard]] std::optional<NmtMessage> decode_nmt(const CanFrame& frame) ABBE_RT;

/// SYNC: no data, or a counter from 1 to the overflow value (1019h).
struct Sync {
  std::optional<std::uint8_t> counter;
};
[[nodiscard]] CanFrame encode_sync(std::optional<std::uint8_t> counter = std::nullopt) ABBE_RT;
[[nodiscard]] std::optional<Sync> decode_sync(const CanFrame& frame) ABBE_RT;

/// NMT state in the heartbeat; 0 is the boot-up message, sent once after a reset.
enum class NodeState : std::uint8_t {
  BootUp = 0,
  Stopped = 4,
  Operational = 5,
  PreOperational = 127
};
struct Heartbeat {
  NodeId node = 0;
  NodeState state{};
};
[[nodiscard]] CanFrame encode_heartbeat(NodeId node, NodeState state) ABBE_RT;
[[nodiscard]] std::optional<Heartbeat> decode_heartbeat(const CanFrame& frame) ABBE_RT;

/// The class of an emergency error code [CiA 301] as text: "communication: CAN overrun", "device
/// specific".
/// Static storage.
[[nodiscard]] const char* emergency_text(std::uint16_t code) noexcept;
/// Bits of the error register 1001h [CiA 301].
enum class ErrorRegister : std::uint8_t {
  Generic = 1u << 0,
  Current = 1u << 1,
  Voltage = 1u << 2,
  Temperature = 1u << 3,
  Communication = 1u << 4,
  Profile = 1u << 5,
  Manufacturer = 1u << 7,
};
struct Emergency {
  NodeId node = 0;
  std::uint16_t code = 0;  ///< 0: error reset, no error is left
  std::uint8_t error_register = 0;
  std::array<std::byte, 5> manufacturer{};
};
[[nodiscard]] CanFrame encode_emergency(const Emergency& emergency) ABBE_RT;
[[nodiscard]] std::optional<Emergency> decode_emergency(const CanFrame& frame) ABBE_RT;

}  // namespace abbe::protocol::can
