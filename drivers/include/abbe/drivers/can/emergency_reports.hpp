#pragma once
/// Emergency messages (EMCY, [CiA 301]) of the encoders of a bus, as text. Sans-I/O. Allocates: not
/// for the RT path; one thread.

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/drivers/can/encoder_receiver.hpp"

namespace abbe::drivers {

class EmergencyReports {
 public:
  static constexpr std::chrono::nanoseconds kSettledAfter = std::chrono::seconds{10};

  explicit EmergencyReports(std::span<const EncoderAxis> axes);

  void on_frame(const can::CanFrame& frame, protocol::HostTime now);
  /// Text of the next fault that was not returned yet; nullopt: none. A fault is the latest
  /// emergency of a node, at most once a second for each node, with the number of other emergencies
  /// of this node since its previous fault.
  [[nodiscard]] std::optional<std::string> take_fault(protocol::HostTime now);
  /// Text that names the axes that are absent, each with the latest emergency of its node, and the
  /// axes whose emergency is not reset; empty if there are none. The latest emergency of a node is
  /// forgotten once its axis has been present and free of emergencies for kSettledAfter.
  [[nodiscard]] std::string condition(std::uint8_t absent_mask, protocol::HostTime now);

 private:
  struct Node {
    std::string axis;
    can::NodeId id = 0;
    std::uint16_t code = 0;  ///< the latest emergency code; 0: none, or error reset
    std::optional<can::Emergency> latest;
    std::optional<protocol::HostTime> reported_at;
    unsigned unreported = 0;
    protocol::HostTime disturbed_at{};  ///< the axis was last absent or had an emergency
  };
  void on_emergency(Node& node, const can::Emergency& emergency, protocol::HostTime now);

  std::vector<Node> nodes_;
};

}  // namespace abbe::drivers
