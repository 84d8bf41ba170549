#pragma once
/// The two implementations of CanPort and their common code.

#include <sys/socket.h>

#include <chrono>

#include "abbe/sim/can_port.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

[[nodiscard]] Result<std::unique_ptr<CanPort>> open_udp_port(const CanPortOptions& options);
[[nodiscard]] Result<std::unique_ptr<CanPort>> open_socket_can_port(const CanPortOptions& options);

/// The age of received messages, from the receive timestamps of the kernel.
class MessageAge {
 public:
  /// Switches timestamps on unless `speed` is 0.
  MessageAge(const Socket& socket, double speed);
  /// The age in simulated time; 0 if there is no timestamp or the system clock was stepped in
  /// between.
  [[nodiscard]] std::chrono::nanoseconds of(const msghdr& message) const;

 private:
  double speed_;
};

}  // namespace abbe::sim
