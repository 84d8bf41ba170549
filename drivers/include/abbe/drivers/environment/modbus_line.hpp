#pragma once
/// One Modbus connection, over TCP or a serial line: libmodbus opens, sets up and sends. Reading is
/// done here, because libmodbus blocks in the middle of an answer and hides the bytes that it
/// refuses, and a recording must hold them. Ordinary world. One thread.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <variant>

#include "abbe/drivers/error.hpp"
#include "abbe/protocol/modbus/read.hpp"

struct _modbus;  // NOLINT(bugprone-reserved-identifier): libmodbus' own name of modbus_t

namespace abbe::drivers {

namespace modbus = protocol::modbus;

struct ModbusTcp {
  std::string
      host;  ///< a name is looked up at every opening, which may take as long as the name server
  std::uint16_t port = modbus::kTcpPort;
};

enum class Parity : char { None = 'N', Even = 'E', Odd = 'O' };

/// A path that survives re-plugging is best: /dev/serial/by-id/...
struct ModbusSerial {
  std::string path;
  int baud = 19200;
  Parity parity = Parity::Even;
  int stop_bits = 1;  ///< 2 with Parity::None [Modbus over Serial Line V1.02, 2.5.1]
};

using ModbusAddress = std::variant<ModbusTcp, ModbusSerial>;
[[nodiscard]] modbus::Transport transport_of(const ModbusAddress& address) noexcept;
/// "10.0.0.7:502", "/dev/ttyUSB0 19200 8E1"
[[nodiscard]] std::string text_of(const ModbusAddress& address);

/// A serial line for one connection only. Two names of a line whose device is not plugged in at the
/// start are not known to be one: whoever opens it second is told. So is a program that locks in
/// this way (flock). TIOCEXCL would keep out others, too, but not root, and is not given back by a
/// process that is killed while another one has the line open.
class SerialLock {
 public:
  SerialLock() = default;
  SerialLock(SerialLock&& other) noexcept { *this = std::move(other); }
  SerialLock& operator=(SerialLock&& other) noexcept;
  ~SerialLock();  ///< gives it back

  /// Unreachable: no such path, or somebody has it. Called once.
  [[nodiscard]] Result<void> take(const std::string& path);

 private:
  int fd_ = -1;
};

class ModbusLine {
 public:
  ModbusLine();
  ~ModbusLine();
  ModbusLine(const ModbusLine&) = delete;
  ModbusLine& operator=(const ModbusLine&) = delete;

  /// Blocks for `wall` at most (and a name server). Unreachable: refused, no route, no such path, a
  /// serial line that is in use; Timeout.
  [[nodiscard]] Result<void> open(const ModbusAddress& address, std::chrono::nanoseconds wall);
  [[nodiscard]] bool is_open() const noexcept { return context_ != nullptr; }
  void close() noexcept;

  /// Unreachable: closed by the device, cable out.
  [[nodiscard]] Result<void> send(const modbus::ReadRequest& request);
  /// Waits for at most `wall`; 0: nothing came. Unreachable: closed by the device, cable out.
  [[nodiscard]] Result<std::size_t> read(std::span<std::byte> into, std::chrono::nanoseconds wall);

 private:
  struct Free {
    void operator()(_modbus* context) const noexcept;
  };
  SerialLock lock_;  ///< given back after the line is closed
  std::unique_ptr<_modbus, Free> context_;
};

}  // namespace abbe::drivers
