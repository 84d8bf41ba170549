#pragma once
/// Bus conditions that the CAN controller reports in Linux error frames (class bits in the
/// identifier) [linux/can/error.h]. Pure, accepts any frame, no allocation.

#include <cstdint>
#include <optional>

#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::can {

/// A condition of the bus. BusConditions combines these bits.
enum class BusCondition : std::uint32_t {
  TransmitTimeout = 1u << 0,
  LostArbitration = 1u << 1,
  ReceiveOverflow = 1u << 2,  ///< overflow in the controller: frames are lost
  TransmitOverflow = 1u << 3,
  Warning = 1u << 4,  ///< an error counter reached 96
  Passive = 1u << 5,  ///< an error counter reached 128
  Active = 1u << 6,   ///< back to error-active
  Protocol = 1u << 7,
  Transceiver = 1u << 8,
  NoAcknowledge = 1u << 9,  ///< no other node on the bus acknowledged a frame
  BusOff = 1u << 10,        ///< the controller left the bus
  BusError = 1u << 11,
  Restarted = 1u << 12,  ///< the controller restarted after bus-off
};
using BusConditions = std::uint32_t;
[[nodiscard]] constexpr bool has(BusConditions set, BusCondition c) noexcept {
  return (set & static_cast<BusConditions>(c)) != 0;
}

struct BusReport {
  BusConditions conditions = 0;
  bool has_counters = false;
  std::uint8_t transmit_errors = 0;  ///< valid with has_counters
  std::uint8_t receive_errors = 0;
};
/// The report in an error frame; nullopt for any other frame.
[[nodiscard]] std::optional<BusReport> decode_error_frame(const CanFrame& frame) ABBE_RT;
/// An error frame with these conditions, for simulators; data[6..7] hold the counters.
[[nodiscard]] CanFrame encode_error_frame(const BusReport& report) ABBE_RT;

}  // namespace abbe::protocol::can
