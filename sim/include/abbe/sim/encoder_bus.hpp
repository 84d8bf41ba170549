#pragma once
/// All encoders of one CAN bus behind one CanPort. Steppable: poll(now) does what is due and never
/// blocks. Not thread-safe.

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "abbe/protocol/can/error_frame.hpp"
#include "abbe/sim/can_port.hpp"
#include "abbe/sim/encoder_node.hpp"
#include "abbe/sim/error.hpp"
#include "abbe/sim/fault.hpp"

namespace abbe::sim {

using EncoderBusOptions = CanPortOptions;

class EncoderBus {
 public:
  [[nodiscard]] static Result<EncoderBus> open(const EncoderBusOptions& options,
                                               std::span<const EncoderNodeOptions> nodes,
                                               const VirtualMachine& machine, HostTime now);

  /// Sends a SYNC every `period` from `first` on, as a machine's control does.
  void produce_sync(std::chrono::nanoseconds period, HostTime first);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  /// Number of frames received from the client, of every kind.
  [[nodiscard]] std::uint64_t frames_received() const { return frames_received_; }
  [[nodiscard]] int fd() const { return port_->fd(); }
  [[nodiscard]] std::uint16_t port() const { return port_->port(); }
  [[nodiscard]] std::deque<EncoderNode>& nodes() { return nodes_; }

  void inject(const Fault& fault, HostTime now);

 private:
  explicit EncoderBus(std::unique_ptr<CanPort> port) : port_(std::move(port)) {}

  void receive(HostTime now);
  void send_sync(HostTime now);
  void collect();
  void send_due(HostTime now);
  void send_error_frame(can::BusCondition condition);
  void end_bus_off(HostTime now);

  std::unique_ptr<CanPort> port_;
  std::deque<EncoderNode> nodes_;    ///< a deque keeps the addresses of the nodes stable
  std::vector<TimedFrame> waiting_;  ///< frames ordered by due time
  std::optional<HostTime> bus_off_until_;
  std::chrono::nanoseconds sync_period_{};
  HostTime next_sync_ = HostTime::max();
  std::uint64_t frames_received_ = 0;
  HostTime bundle_until_ = HostTime::min();
  HostTime next_bundle_{};
  std::chrono::nanoseconds bundle_every_{};
  struct AllClear {
    HostTime due;
    std::uint8_t node;
  };
  std::vector<AllClear> all_clears_;
};

}  // namespace abbe::sim
