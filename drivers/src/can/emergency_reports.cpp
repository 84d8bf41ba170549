#include "abbe/drivers/can/emergency_reports.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/protocol/can/control_emergency.hpp"

namespace abbe::drivers {

using protocol::HostTime;

namespace {

constexpr std::chrono::seconds kReportAgainAfter{1};

std::string text_of(const can::Emergency& emergency) {
  if (const auto cause = can::control_cause(emergency)) return can::to_text(*cause);
  return fmt::format("EMCY {:04X}h ({}), error register {:02X}h", emergency.code,
                     can::emergency_text(emergency.code), emergency.error_register);
}

}  // namespace

EmergencyReports::EmergencyReports(std::span<const EncoderAxis> axes) {
  for (const auto& axis : axes) nodes_.push_back({.axis = axis.name, .id = axis.node});
}

void EmergencyReports::on_frame(const can::CanFrame& frame, HostTime now) {
  if (const auto emergency = can::decode_emergency(frame)) {
    for (auto& node : nodes_) {
      if (node.id == emergency->node) on_emergency(node, *emergency, now);
    }
  } else if (const auto heartbeat = can::decode_heartbeat(frame)) {
    for (auto& node : nodes_) {
      if (node.id == heartbeat->node && heartbeat->state == can::NodeState::BootUp) node.code = 0;
    }
  }
}

void EmergencyReports::on_emergency(Node& node, const can::Emergency& emergency, HostTime now) {
  // A control repeats its emergency while the cause lasts; this is not a new fault.
  const bool repeated = node.code != 0 && node.latest && can::control_cause(emergency) &&
                        can::control_cause(emergency) == can::control_cause(*node.latest);
  if (repeated) {
    node.disturbed_at = now;
    return;
  }

  const bool other = !node.latest || node.latest->code != emergency.code;
  node.code = emergency.code;
  if (emergency.code == 0) return;
  node.latest = emergency;
  node.disturbed_at = now;
  if (other || !node.reported_at || now - *node.reported_at >= kReportAgainAfter) ++node.unreported;
}

std::optional<std::string> EmergencyReports::take_fault(HostTime now) {
  for (auto& node : nodes_) {
    if (node.unreported == 0 || !node.latest ||
        (node.reported_at && now - *node.reported_at < kReportAgainAfter))
      continue;
    node.reported_at = now;
    const auto others = std::exchange(node.unreported, 0u) - 1;
    auto text = fmt::format("encoder {} (node {}): {}", node.axis, node.id, text_of(*node.latest));
    if (others > 0) text += fmt::format(" and {} others", others);
    return text;
  }
  return std::nullopt;
}

std::string EmergencyReports::condition(std::uint8_t absent_mask, HostTime now) {
  std::string text;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    auto& node = nodes_[i];
    const bool absent = ((absent_mask >> i) & 1u) != 0;
    if (!absent && node.code == 0) {
      if (node.unreported == 0 && now - node.disturbed_at >= kSettledAfter) node.latest.reset();
      continue;
    }
    node.disturbed_at = now;
    text += fmt::format("{}{}{} (node {})", text.empty() ? "" : "; ", node.axis,
                        absent ? " missing" : "", node.id);
    if (node.latest) text += ": " + text_of(*node.latest);
  }

  return text;
}

}  // namespace abbe::drivers
