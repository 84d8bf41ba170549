#pragma once
/// The bus connection of the simulated nodes: CAN over UDP on 127.0.0.1 with the cannelloni
/// framing, or a SocketCAN interface (vcan). Never blocks. Not thread-safe.

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
  std::uint16_t peer_port = 0;  ///< UDP on 127.0.0.1; 0: the sender of the latest datagram
  std::string interface {};     ///< SocketCAN instead of UDP: "vcan0"
  /// Simulated seconds per wall-clock second. A frame is dated by its kernel timestamp, not by the
  /// time at which this process woke up. 0 for a clock that a test advances in steps: the age of
  /// every frame is then 0.
  double speed = 0.0;
};

struct ArrivedFrame {
  can::CanFrame frame;
  std::chrono::nanoseconds age{};  ///< simulated time from the arrival in the kernel until now
};

class CanPort {
 public:
  /// Error Io if the port is in use, or if there is no such interface.
  [[nodiscard]] static Result<std::unique_ptr<CanPort>> open(const CanPortOptions& options);

  CanPort() = default;
  CanPort(const CanPort&) = delete;
  CanPort& operator=(const CanPort&) = delete;
  virtual ~CanPort() = default;

  /// The frames received since the last call. Their number is bounded, so that a flood of frames
  /// does not block the other devices. Valid until the next call.
  [[nodiscard]] virtual std::span<const ArrivedFrame> receive() = 0;
  /// Frames sent without a listener are lost, as on a real bus.
  virtual void send(std::span<const can::CanFrame> frames) = 0;
  /// Sends malformed data: on UDP bytes that are not a cannelloni datagram, on CAN frames that no
  /// encoder sends.
  virtual void send_garbage() = 0;
  [[nodiscard]] virtual bool has_listener() const = 0;

  [[nodiscard]] virtual int fd() const = 0;
  [[nodiscard]] virtual std::uint16_t port() const { return 0; }  ///< UDP port; 0: none
};

}  // namespace abbe::sim
