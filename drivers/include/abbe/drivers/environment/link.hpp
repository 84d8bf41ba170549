#pragma once
/// The connection that the Modbus devices of one serial line, or behind one gateway, have in
/// common: one request at a time. Device thread, ordinary world.

#include <chrono>
#include <cstdint>

#include "abbe/drivers/environment/modbus_line.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

struct EnvironmentLink {
  ModbusLine line;
  std::uint64_t openings = 0;    ///< a device that knows an earlier number begins anew
  std::uint64_t answers = 0;     ///< of all devices
  protocol::HostTime open_at{};  ///< not opened again before
  protocol::HostTime
      quiet_until{};  ///< what comes until then is an answer that is too late: thrown away
};

/// One serial device (by any of its names) or one host and port.
[[nodiscard]] bool same_line(const ModbusAddress& a, const ModbusAddress& b);
/// Baud rate, parity and stop bits; TCP has none.
[[nodiscard]] bool same_settings(const ModbusAddress& a, const ModbusAddress& b);
/// 3.5 characters between two telegrams [Modbus over Serial Line V1.02, 2.5.1.1]; 0 over TCP.
[[nodiscard]] std::chrono::nanoseconds silence_between(const ModbusAddress& address);

}  // namespace abbe::drivers
