#pragma once
/// The connection shared by the Modbus devices of one serial line or behind one gateway: one
/// request at a time. Device thread, not real-time.

#include <chrono>
#include <cstdint>

#include "abbe/drivers/environment/modbus_line.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

struct EnvironmentLink {
  ModbusLine line;
  /// incremented at each opening; a device that has stored another number restarts its reading
  std::uint64_t openings = 0;
  std::uint64_t answers = 0;         ///< number of answers of all devices
  protocol::HostTime open_at{};      ///< earliest time to open the line again
  protocol::HostTime quiet_until{};  ///< bytes until then are a late answer and are discarded
};

/// True for the same serial device (under any of its paths), or the same host and port.
[[nodiscard]] bool same_line(const ModbusAddress& a, const ModbusAddress& b);
/// True for the same baud rate, parity and stop bits; always true for two TCP addresses.
[[nodiscard]] bool same_settings(const ModbusAddress& a, const ModbusAddress& b);
/// Silent interval between two telegrams: 3.5 characters [Modbus over Serial Line V1.02, 2.5.1.1];
/// 0 over TCP.
[[nodiscard]] std::chrono::nanoseconds silence_between(const ModbusAddress& address);

}  // namespace abbe::drivers
