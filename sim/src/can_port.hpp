#pragma once
/// The two ports of can_port.hpp, and what they share.

#include <sys/socket.h>

#include <chrono>

#include "abbe/sim/can_port.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

[[nodiscard]] Result<std::unique_ptr<CanPort>> open_udp_port(const CanPortOptions& options);
[[nodiscard]] Result<std::unique_ptr<CanPort>> open_socket_can_port(const CanPortOptions& options);

/// How long ago the kernel took messages in, by its own stamps.
class MessageAge {
 public:
  /// Asks for stamps unless `speed` is 0.
  MessageAge(const Socket& socket, double speed);
  /// In simulated time; zero when the kernel did not say or its clock was stepped meanwhile.
  [[nodiscard]] std::chrono::nanoseconds of(const msghdr& message) const;

 private:
  double speed_;
};

}  // namespace abbe::sim
