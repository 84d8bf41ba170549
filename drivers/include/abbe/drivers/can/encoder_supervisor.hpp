#pragma once
/// Configures every node of an encoder bus: at start, after a boot-up message, when a node does not
/// answer, and after bus-off. Sans-I/O: frames and a time in, frames out. Each node has its own
/// configurator; they run concurrently. Composes texts: not for the RT path. One thread.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/protocol/can/encoder_configurator.hpp"

namespace abbe::drivers {

struct SupervisorOptions {
  std::uint16_t heartbeat_ms = 100;
  /// A configured node that does not answer the SYNC for this long is reported and configured
  /// again.
  std::chrono::nanoseconds silence = std::chrono::milliseconds{350};
  /// wait after a failed configuration
  std::chrono::nanoseconds retry_after = std::chrono::seconds{1};
  can::SdoClientOptions sdo{};
};

class EncoderSupervisor {
 public:
  EncoderSupervisor(std::span<const EncoderAxis> axes, const SupervisorOptions& options);

  void start(protocol::HostTime now);
  /// Ends every configuration and discards pending frames: nothing is sent until start() is called.
  void stop();
  /// The bus has recovered from bus-off: sends NMT reset communication to each node of this
  /// supervisor by its own node ID (node ID 0 would address every drive on the bus), then
  /// configures the nodes.
  void bus_recovered(protocol::HostTime now);
  /// A SYNC was sent at `now`; configured nodes must answer it.
  void on_sync(protocol::HostTime now);
  void on_frame(const can::CanFrame& frame, protocol::HostTime now);
  /// Precondition: all frames that arrived before `now` were passed to on_frame().
  void on_time(protocol::HostTime now);
  [[nodiscard]] std::optional<can::CanFrame> take_frame();
  /// The time at which on_time() must be called next.
  [[nodiscard]] protocol::HostTime deadline() const;

  [[nodiscard]] std::size_t nodes() const { return nodes_.size(); }
  [[nodiscard]] std::size_t ready() const;
  /// The next fault that was not returned yet, as text. The same fault of a node is returned once,
  /// and again only after the node has delivered positions for a second.
  [[nodiscard]] std::optional<std::string> take_fault();
  /// Identifiers of all frames from the nodes, for CanBus::open().
  [[nodiscard]] std::vector<std::uint32_t> ids() const;

 private:
  enum class State : std::uint8_t { Waiting, Configuring, Ready };
  struct Node {
    EncoderAxis axis;
    can::EncoderConfigurator configurator;
    State state = State::Waiting;
    protocol::HostTime started{};
    protocol::HostTime retry_at{};
    protocol::HostTime ready_at{};
    /// time of the first SYNC that was not answered
    std::optional<protocol::HostTime> unanswered_sync;
    unsigned idle_beats = 0;  ///< consecutive heartbeats other than "operational"
    can::ConfigurationFault reported = can::ConfigurationFault::None;
  };

  void configure(Node& node, protocol::HostTime now);
  void follow(Node& node, protocol::HostTime now);
  void on_position(Node& node, protocol::HostTime now);
  void on_dropped(Node& node, can::NodeState state, protocol::HostTime now);
  void on_heartbeat(Node& node, can::NodeState state, protocol::HostTime now);
  void report(Node& node, can::ConfigurationFault fault, std::string text);
  [[nodiscard]] static bool is_from(const Node& node, const can::CanFrame& frame);

  SupervisorOptions options_;
  std::vector<Node> nodes_;
  std::vector<can::CanFrame> resets_;
  std::vector<std::string> faults_;
};

}  // namespace abbe::drivers
