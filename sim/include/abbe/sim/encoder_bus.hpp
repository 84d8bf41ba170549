#pragma once
/// All encoders of one CAN bus behind one UDP endpoint with the cannelloni framing. It answers whoever spoke
/// last, or a fixed peer. Steppable: poll(now) does what is due and never blocks. Not thread-safe.

#include <sys/socket.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "abbe/protocol/can/error_frame.hpp"
#include "abbe/sim/encoder_node.hpp"
#include "abbe/sim/error.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

struct EncoderBusOptions {
  std::uint16_t port = 0;       ///< on 127.0.0.1; 0: the kernel chooses
  std::uint16_t peer_port = 0;  ///< on 127.0.0.1; 0: learnt from the first datagram
  /// Simulated seconds per wall second, to date a SYNC by its kernel stamp instead of by when this process
  /// woke up; 0 with a stepped clock: `now` is the arrival.
  double speed = 0.0;
};

class EncoderBus {
 public:
  [[nodiscard]] static Result<EncoderBus> open(const EncoderBusOptions& options,
                                               std::span<const EncoderNodeOptions> nodes,
                                               const VirtualMachine& machine, HostTime now);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] int fd() const { return socket_.get(); }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::deque<EncoderNode>& nodes() { return nodes_; }

  void inject(const Fault& fault, HostTime now);

 private:
  EncoderBus(Socket socket, const EncoderBusOptions& options);

  void receive(HostTime now);
  void on_datagram(std::span<const std::byte> bytes, HostTime at);
  void collect();
  void send_due(HostTime now);
  void send_datagram(std::span<const std::byte> bytes);
  void send_error_frame(can::BusCondition condition);
  void end_bus_off(HostTime now);

  Socket socket_;
  std::uint16_t port_ = 0;
  double speed_ = 0.0;
  bool has_peer_ = false;
  sockaddr_storage peer_{};
  std::uint8_t sequence_ = 0;
  std::deque<EncoderNode> nodes_;    ///< a deque: the nodes stay where they were made
  std::vector<TimedFrame> waiting_;  ///< by due time
  std::optional<HostTime> bus_off_until_;
  struct AllClear {
    HostTime due;
    std::uint8_t node;
  };
  std::vector<AllClear> all_clears_;
};

}  // namespace abbe::sim
