#pragma once
/// What the encoders of a bus report of themselves (EMCY), in words. Sans-I/O. Ordinary world; one
/// thread.

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
  /// A fault not reported yet: of each node the latest, at most one a second, with how many others
  /// it stands for.
  [[nodiscard]] std::optional<std::string> take_fault(protocol::HostTime now);
  /// Axes that are absent, each with the latest emergency of its node, and axes with an emergency
  /// that was not taken back; empty: none. The emergency of an axis that was well for kSettledAfter
  /// is forgotten.
  [[nodiscard]] std::string condition(std::uint8_t absent_mask, protocol::HostTime now);

 private:
  struct Node {
    std::string axis;
    can::NodeId id = 0;
    std::uint16_t code = 0;  ///< 0: none, or taken back
    std::optional<can::Emergency> latest;
    std::optional<protocol::HostTime> told;
    unsigned to_tell = 0;
    protocol::HostTime unwell{};  ///< when it last was absent or had an emergency
  };
  void on_emergency(Node& node, const can::Emergency& emergency, protocol::HostTime now);

  std::vector<Node> nodes_;
};

}  // namespace abbe::drivers
