#pragma once
/// A simulated Modbus device behind a TCP port or a pseudo terminal, on libmodbus' server
/// functions. It accepts up to two TCP clients, as the Comet transmitter does. Steppable: poll(now)
/// does what is due and blocks only on an incomplete request (at most 20 ms). Not thread-safe.

#include <poll.h>

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "abbe/sim/error.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/modbus_registers.hpp"

namespace abbe::sim {

struct ModbusTcpEndpoint {
  std::uint16_t port = 0;  ///< port on 127.0.0.1; 0: the kernel chooses
};
/// `link`: the path of a symbolic link to the client's end of the pseudo terminal. An existing link
/// is replaced.
struct ModbusPtyEndpoint {
  std::string link;
};

struct ModbusServerOptions {
  std::string name = "environment";
  ModbusIdentity identity;
  EnvironmentModel environment;
  std::variant<ModbusTcpEndpoint, ModbusPtyEndpoint> endpoint;
};

class ModbusServer {
 public:
  /// Error Io: the port is in use, there is no pseudo terminal or the link cannot be created.
  [[nodiscard]] static Result<ModbusServer> open(const ModbusServerOptions& options, HostTime now);
  ModbusServer(ModbusServer&&) noexcept;
  ModbusServer& operator=(ModbusServer&&) noexcept;
  ~ModbusServer();  ///< removes the link

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  void add_poll_fds(std::vector<pollfd>& fds) const;
  void inject(const Fault& fault, HostTime now);

  [[nodiscard]] const std::string& name() const;
  [[nodiscard]] std::uint16_t port() const;  ///< 0 if it is on a pseudo terminal
  [[nodiscard]] std::string path() const;    ///< path of the pseudo terminal's link; empty for TCP
  /// Text such as "Modbus TCP on 127.0.0.1:40001" or "Modbus RTU on /tmp/rtd".
  [[nodiscard]] std::string where() const;

 private:
  struct State;
  explicit ModbusServer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::sim
