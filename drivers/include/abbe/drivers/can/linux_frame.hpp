#pragma once
/// Conversion between CanFrame and the structures of SocketCAN [linux/can.h], and the receive
/// filters for a set of identifiers. Pure; from_linux accepts any bytes.

#include <linux/can.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "abbe/protocol/can/frame.hpp"

namespace abbe::drivers {

namespace can = protocol::can;

/// Converts a received frame. `size` is the number of bytes that read() returned: CAN_MTU for a
/// classic frame, CANFD_MTU for a CAN FD frame; any other size gives nullopt.
[[nodiscard]] std::optional<can::CanFrame> from_linux(const canfd_frame& frame,
                                                      std::size_t size) noexcept;

struct LinuxFrame {
  canfd_frame frame{};
  std::size_t size = 0;  ///< bytes to write
};
[[nodiscard]] LinuxFrame to_linux(const can::CanFrame& frame) noexcept;

/// One filter per identifier: data frames with exactly this 11-bit identifier.
[[nodiscard]] std::vector<can_filter> filters_for(std::span<const std::uint32_t> ids);

}  // namespace abbe::drivers
