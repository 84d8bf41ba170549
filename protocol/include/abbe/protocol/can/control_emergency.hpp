#pragma once
/// Emergency messages [CiA 301] with which abbe-linuxcnc-encoder reports why a joint of LinuxCNC
/// has no position. Code FF01h is device specific. The five manufacturer bytes are "LCNC" and the
/// cause, so that the same code of another device is not mistaken for one of these. Pure, no
/// allocation.

#include <cstdint>
#include <optional>

#include "abbe/protocol/can/canopen.hpp"

namespace abbe::protocol::can {

enum class ControlCause : std::uint8_t {
  NotHomed = 1,
  NoPosition = 2,  ///< the position is not finite, or exceeds 32 bits
};
[[nodiscard]] const char* to_text(ControlCause cause) noexcept;  ///< static storage

/// The emergency that `node` sends for a cause; nullopt: error reset, the joint has a position.
[[nodiscard]] Emergency control_emergency(NodeId node, std::optional<ControlCause> cause);
/// The cause in an emergency; nullopt: an emergency of another device, or an error reset.
[[nodiscard]] std::optional<ControlCause> control_cause(const Emergency& emergency);

}  // namespace abbe::protocol::can
