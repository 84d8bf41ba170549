#pragma once
/// One Modbus connection, over TCP or a serial line. libmodbus opens and configures the connection
/// and sends. Reading is implemented here, because libmodbus blocks in the middle of an answer and
/// does not return rejected bytes, which a recording must contain. Not real-time. One thread.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>

#include "abbe/drivers/error.hpp"
#include "abbe/drivers/host_addresses.hpp"
#include "abbe/drivers/serial_line.hpp"
#include "abbe/protocol/modbus/read.hpp"

struct _modbus;  // NOLINT(bugprone-reserved-identifier): libmodbus' own name of modbus_t

namespace abbe::drivers {

namespace modbus = protocol::modbus;

struct ModbusTcp {
  std::string host;  ///< IP address or host name
  std::uint16_t port = modbus::kTcpPort;
};

/// A serial line. Use a path that does not change when the adapter is plugged in again:
/// /dev/serial/by-id/...
struct ModbusSerial {
  std::string path;
  int baud = 19200;
  Parity parity = Parity::Even;
  int stop_bits = 1;  ///< 2 with Parity::None [Modbus over Serial Line V1.02, 2.5.1]
};

using ModbusAddress = std::variant<ModbusTcp, ModbusSerial>;
[[nodiscard]] modbus::Transport transport_of(const ModbusAddress& address) noexcept;
/// Text of an address: "10.0.0.7:502", "/dev/ttyUSB0 19200 8E1".
[[nodiscard]] std::string text_of(const ModbusAddress& address);

class ModbusLine {
 public:
  ModbusLine();
  ~ModbusLine();
  ModbusLine(const ModbusLine&) = delete;
  ModbusLine& operator=(const ModbusLine&) = delete;

  /// Opens the connection. `address` must be the same in every call. Blocks for at most `wall`; the
  /// first call also waits at most 1 s for the address of a host name: see HostAddresses. Error
  /// Unreachable (refused, no route, no such path, serial line in use) or Timeout.
  [[nodiscard]] Result<void> open(const ModbusAddress& address, std::chrono::nanoseconds wall);
  [[nodiscard]] bool is_open() const noexcept { return context_ != nullptr; }
  void close() noexcept;

  /// Error Unreachable: the device closed the connection, or the cable is unplugged.
  [[nodiscard]] Result<void> send(const modbus::ReadRequest& request);
  /// Waits for at most `wall`. Returns the number of bytes read, 0 if none arrived. Error
  /// Unreachable: the device closed the connection, or the cable is unplugged.
  [[nodiscard]] Result<std::size_t> read(std::span<std::byte> into, std::chrono::nanoseconds wall);

 private:
  struct Free {
    void operator()(_modbus* context) const noexcept;
  };
  std::optional<HostAddresses> host_;  ///< addresses of a ModbusTcp host
  SerialLock lock_;                    ///< declared first: released after the line is closed
  std::unique_ptr<_modbus, Free> context_;
};

}  // namespace abbe::drivers
