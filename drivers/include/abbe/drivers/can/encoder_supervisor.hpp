#pragma once
/// Keeps every node of an encoder bus configured: at start, after a boot-up message, after silence,
/// after bus-off. Sans-I/O: frames and a time in, frames out; one configurator per node, all at
/// once. Ordinary world (composes texts). One thread.

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
  std::chrono::nanoseconds silence = std::chrono::milliseconds{
      350};  ///< a ready node that does not answer the SYNC for so long is lost
  /// after a configuration that failed
  std::chrono::nanoseconds retry_after = std::chrono::seconds{1};
  can::SdoClientOptions sdo{};
};

class EncoderSupervisor {
 public:
  EncoderSupervisor(std::span<const EncoderAxis> axes, const SupervisorOptions& options);

  void start(protocol::HostTime now);
  /// Nothing may be sent any more: forgets what was under way. start() begins again.
  void stop();
  /// The bus is back from bus-off: resets the communication of these nodes, each by its own number
  /// (node 0 would be every drive on the bus), then configures them.
  void bus_recovered(protocol::HostTime now);
  /// A SYNC was sent: ready nodes have to answer.
  void on_sync(protocol::HostTime now);
  void on_frame(const can::CanFrame& frame, protocol::HostTime now);
  /// Everything that had come until `now` was handed to on_frame().
  void on_time(protocol::HostTime now);
  [[nodiscard]] std::optional<can::CanFrame> take_frame();
  /// When on_time() has something to do.
  [[nodiscard]] protocol::HostTime deadline() const;

  [[nodiscard]] std::size_t nodes() const { return nodes_.size(); }
  [[nodiscard]] std::size_t ready() const;
  /// A fault not reported yet, in words; each node reports the same fault once until its positions
  /// came again for a second.
  [[nodiscard]] std::optional<std::string> take_fault();
  /// Identifiers that nodes send with: what the bus must deliver.
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
    std::optional<protocol::HostTime> asked;  ///< the first SYNC it has not answered
    unsigned idle_beats = 0;                  ///< heartbeats in a row that were not "operational"
    can::ConfigurationFault told = can::ConfigurationFault::None;
  };

  void configure(Node& node, protocol::HostTime now);
  void follow(Node& node, protocol::HostTime now);
  void on_position(Node& node, protocol::HostTime now);
  void on_dropped(Node& node, can::NodeState state, protocol::HostTime now);
  void on_heartbeat(Node& node, can::NodeState state, protocol::HostTime now);
  void tell(Node& node, can::ConfigurationFault fault, std::string text);
  [[nodiscard]] static bool is_from(const Node& node, const can::CanFrame& frame);

  SupervisorOptions options_;
  std::vector<Node> nodes_;
  std::vector<can::CanFrame> resets_;
  std::vector<std::string> faults_;
};

}  // namespace abbe::drivers
