#pragma once
/// CanFrame to and from the structures of SocketCAN [linux/can.h], and the receive filters for a
/// set of identifiers. Pure; from_linux is total.

#include <linux/can.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "abbe/protocol/can/frame.hpp"

namespace abbe::drivers {

namespace can = protocol::can;

/// A read of `size` bytes: CAN_MTU is a classic frame, CANFD_MTU a CAN FD frame; anything else is
/// none.
[[nodiscard]] std::optional<can::CanFrame> from_linux(const canfd_frame& frame,
                                                      std::size_t size) noexcept;

struct LinuxFrame {
  canfd_frame frame{};
  std::size_t size = 0;  ///< bytes to write
};
[[nodiscard]] LinuxFrame to_linux(const can::CanFrame& frame) noexcept;

/// One filter for each identifier: data frames with exactly these 11 bits.
[[nodiscard]] std::vector<can_filter> filters_for(std::span<const std::uint32_t> ids);

}  // namespace abbe::drivers
