#pragma once
/// Where simulated nodes meet the bus: CAN over UDP on 127.0.0.1 with the cannelloni framing, or a
/// SocketCAN interface (vcan). Never blocks. Not thread-safe.

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "abbe/protocol/can/frame.hpp"
#include "abbe/sim/error.hpp"

namespace abbe::sim {

namespace can = protocol::can;

struct CanPortOptions {
  std::uint16_t port = 0;       ///< UDP on 127.0.0.1; 0: the kernel chooses
  std::uint16_t peer_port = 0;  ///< UDP on 127.0.0.1; 0: whoever spoke last
  std::string interface {};     ///< SocketCAN instead of UDP: "vcan0"
  /// Simulated seconds per wall second, to date a frame by its kernel stamp instead of by when this
  /// process woke up; 0 with a stepped clock: frames have no age.
  double speed = 0.0;
};

struct ArrivedFrame {
  can::CanFrame frame;
  std::chrono::nanoseconds age{};  ///< since the kernel took it in, simulated time
};

class CanPort {
 public:
  /// Io when the port is taken, or there is no such interface.
  [[nodiscard]] static Result<std::unique_ptr<CanPort>> open(const CanPortOptions& options);

  CanPort() = default;
  CanPort(const CanPort&) = delete;
  CanPort& operator=(const CanPort&) = delete;
  virtual ~CanPort() = default;

  /// What came since the last call, in a bounded number so that a flood cannot keep other devices
  /// from their turn. Valid until the next call.
  [[nodiscard]] virtual std::span<const ArrivedFrame> receive() = 0;
  /// Without a listener the frames are gone, as on a real bus.
  virtual void send(std::span<const can::CanFrame> frames) = 0;
  /// What is no answer of any node: on UDP bytes that are no datagram, on CAN frames that fit no
  /// protocol.
  virtual void send_garbage() = 0;
  [[nodiscard]] virtual bool has_listener() const = 0;

  [[nodiscard]] virtual int fd() const = 0;
  [[nodiscard]] virtual std::uint16_t port() const { return 0; }  ///< UDP; 0: none
};

}  // namespace abbe::sim
