#pragma once
/// Receives the position records of a control over UDP (loopback), for a machine that follows the
/// control. Not thread-safe, but the motion is.

#include <cstdint>
#include <memory>

#include "abbe/sim/followed_motion.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

class ControlPort {
 public:
  /// Port 0: the kernel chooses. Error Io if the port is in use.
  [[nodiscard]] static Result<ControlPort> open(std::uint16_t port);

  /// Reads all records that have arrived. `now`: the time of their arrival.
  void poll(HostTime now);
  [[nodiscard]] int fd() const { return socket_.get(); }
  [[nodiscard]] std::uint16_t port() const { return port_of(socket_); }
  [[nodiscard]] const std::shared_ptr<FollowedMotion>& motion() const { return motion_; }
  /// Datagrams that are not position records; they are discarded.
  [[nodiscard]] std::uint64_t not_records() const { return not_records_; }

 private:
  explicit ControlPort(Socket socket)
      : socket_(std::move(socket)), motion_(std::make_shared<FollowedMotion>()) {}

  Socket socket_;
  std::shared_ptr<FollowedMotion> motion_;
  std::uint64_t not_records_ = 0;
};

}  // namespace abbe::sim
