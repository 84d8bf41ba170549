#include "abbe/drivers/can/encoder_supervisor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/protocol/can/cia406.hpp"

namespace abbe::drivers {

using can::ConfigurationFault;
using protocol::HostTime;

namespace {

/// A second boot-up message within this time does not restart the configuration: otherwise every
/// message of a node that boots repeatedly would cause further SDO traffic.
constexpr std::chrono::milliseconds kBetweenStarts{50};
/// The first heartbeat that is not "operational" may have been sent before the NMT start; the
/// second one in a row shows that the node is not operational.
constexpr unsigned kIdleBeats = 2;
/// A node that has answered for this long has recovered: its next fault is reported again.
constexpr std::chrono::seconds kSettledAfter{1};

constexpr double kNanometresPerMetre = 1e9;

/// True for an error with which a repeated configuration would fail in the same way. The supervisor
/// then waits for the boot-up message of a replaced or power-cycled node.
bool is_final(const can::ConfigurationError& error) {
  switch (error.fault) {
    case ConfigurationFault::WrongStep:
    case ConfigurationFault::FixedMapping:
    case ConfigurationFault::FixedType:
      return true;
    case ConfigurationFault::Refused:
      return can::is_lasting(error.abort_code) && error.object.index >= can::object::kTpdoMapping &&
             error.object.index <= can::object::kTpdoMapping + 1;
    default:
      return false;
  }
}

/// The configured and the reported step as text: "20 nm, configured is step_nm = 10".
std::string steps(const EncoderAxis& axis, std::uint32_t seen) {
  const double configured = std::abs(axis.scale.value_or(0.0)) * kNanometresPerMetre;
  if (axis.kind == AxisKind::Linear)
    return fmt::format("{} nm, configured is step_nm = {:.10g}", seen, configured);
  return fmt::format("{} counts per revolution ({:.10g} nrad), configured is step_nrad = {:.10g}",
                     seen, 2.0 * std::numbers::pi * kNanometresPerMetre / seen, configured);
}

can::EncoderPlan plan_of(const EncoderAxis& axis, std::uint16_t heartbeat_ms) {
  can::EncoderPlan plan;
  plan.node = axis.node;
  plan.position = axis.position;
  plan.tpdo = axis.tpdo;
  plan.heartbeat_ms = heartbeat_ms;
  plan.serial = axis.serial;
  plan.linear = axis.kind == AxisKind::Linear;
  plan.needs_scale = !axis.scale.has_value();
  if (axis.scale && plan.linear.value_or(true))
    plan.step_nm = std::abs(*axis.scale) * kNanometresPerMetre;
  if (axis.scale && !plan.linear.value_or(true))
    plan.units_per_revolution = 2.0 * std::numbers::pi / std::abs(*axis.scale);

  return plan;
}

std::string describe(const EncoderAxis& axis, const can::ConfigurationError& error) {
  auto text = fmt::format("encoder {} (node {}): configure {:04X}h:{:02X}: {}", axis.name,
                          axis.node, error.object.index, error.object.sub, to_text(error.fault));
  if (error.fault == ConfigurationFault::Refused) {
    text += fmt::format(": {} ({:08X}h)", to_text(error.abort_code),
                        static_cast<std::uint32_t>(error.abort_code));
  } else if (error.fault == ConfigurationFault::WrongStep) {
    text += ": " + steps(axis, error.seen);
  } else if (error.fault == ConfigurationFault::FixedMapping) {
    text += fmt::format(": try tpdo = {}", axis.tpdo == 1 ? 2 : 1);
  } else if (error.fault == ConfigurationFault::FixedType) {
    text += fmt::format(" but {}: try tpdo = {}", error.seen, axis.tpdo == 1 ? 2 : 1);
  } else if (error.seen != 0) {
    text += fmt::format(": {:08X}h", error.seen);
  }

  return text;
}

}  // namespace

EncoderSupervisor::EncoderSupervisor(std::span<const EncoderAxis> axes,
                                     const SupervisorOptions& options)
    : options_(options) {
  for (const auto& axis : axes) {
    nodes_.push_back(
        {axis, can::EncoderConfigurator{plan_of(axis, options.heartbeat_ms), options.sdo}});
  }
}

std::vector<std::uint32_t> EncoderSupervisor::ids() const {
  std::vector<std::uint32_t> ids;
  for (const auto& node : nodes_) {
    ids.push_back(can::cob::kEmergency + node.axis.node);
    ids.push_back(can::cob::tpdo(node.axis.tpdo, node.axis.node));
    ids.push_back(can::cob::kSdoResponse + node.axis.node);
    ids.push_back(can::cob::kHeartbeat + node.axis.node);
  }
  return ids;
}

bool EncoderSupervisor::is_from(const Node& node, const can::CanFrame& frame) {
  const auto id = node.axis.node;
  return frame.is_standard_data() &&
         (frame.id == can::cob::tpdo(node.axis.tpdo, id) || frame.id == can::cob::kHeartbeat + id ||
          frame.id == can::cob::kSdoResponse + id || frame.id == can::cob::kEmergency + id);
}

void EncoderSupervisor::start(HostTime now) {
  for (auto& node : nodes_) configure(node, now);
}

void EncoderSupervisor::stop() {
  resets_.clear();
  for (auto& node : nodes_) {
    while (node.configurator.take_frame()) {
    }
    node.state = State::Waiting;
    node.retry_at = HostTime::max();
  }
}

void EncoderSupervisor::bus_recovered(HostTime now) {
  for (auto& node : nodes_) {
    resets_.push_back(can::encode_nmt(can::NmtCommand::ResetCommunication, node.axis.node));
    node.state = State::Waiting;  // the node waits for its boot-up message, or until retry_at
    node.retry_at = now + options_.sdo.timeout;
  }
}

void EncoderSupervisor::configure(Node& node, HostTime now) {
  node.state = State::Configuring;
  node.started = now;
  node.idle_beats = 0;
  node.configurator.start(now);
}

void EncoderSupervisor::on_frame(const can::CanFrame& frame, HostTime now) {
  for (auto& node : nodes_) {
    if (!is_from(node, frame)) continue;
    if (frame.id == can::cob::tpdo(node.axis.tpdo, node.axis.node)) {
      on_position(node, now);
    } else if (const auto heartbeat = can::decode_heartbeat(frame)) {
      on_heartbeat(node, heartbeat->state, now);
    }
    if (node.state != State::Configuring) continue;
    node.configurator.on_frame(frame, now);
    follow(node, now);
  }
}

void EncoderSupervisor::on_sync(HostTime now) {
  for (auto& node : nodes_) {
    if (node.state == State::Ready && !node.unanswered_sync) node.unanswered_sync = now;
  }
}

void EncoderSupervisor::on_position(Node& node, HostTime now) {
  node.unanswered_sync.reset();
  if (node.state == State::Ready && now - node.ready_at >= kSettledAfter)
    node.reported = ConfigurationFault::None;
}

void EncoderSupervisor::on_heartbeat(Node& node, can::NodeState state, HostTime now) {
  if (state == can::NodeState::BootUp) {
    if (node.state != State::Configuring || now - node.started >= kBetweenStarts)
      configure(node, now);
    return;
  }
  if (node.state == State::Waiting && node.reported == ConfigurationFault::Silent) {
    return configure(node, now);  // the configuration makes the node send heartbeats again
  }
  node.idle_beats = state == can::NodeState::Operational ? 0 : node.idle_beats + 1;
  if (node.state == State::Ready && node.idle_beats >= kIdleBeats) on_dropped(node, state, now);
}

/// The node has left the state "operational" without a command. A node that does so repeatedly is
/// configured at most once per retry_after.
void EncoderSupervisor::on_dropped(Node& node, can::NodeState state, HostTime now) {
  report(node, ConfigurationFault::NotOperational,
         fmt::format("encoder {} (node {}): left the state operational without a command ({}): it "
                     "is configured again",
                     node.axis.name, node.axis.node,
                     state == can::NodeState::Stopped ? "stopped" : "pre-operational"));
  if (now - node.ready_at >= kSettledAfter) return configure(node, now);
  node.state = State::Waiting;
  node.retry_at = now + options_.retry_after;
}

void EncoderSupervisor::on_time(HostTime now) {
  for (auto& node : nodes_) {
    switch (node.state) {
      case State::Waiting:
        if (now >= node.retry_at) configure(node, now);
        break;
      case State::Configuring:
        node.configurator.on_time(now);
        follow(node, now);
        break;
      case State::Ready:
        if (!node.unanswered_sync || now - *node.unanswered_sync < options_.silence) break;
        report(
            node, ConfigurationFault::Silent,
            fmt::format(
                "encoder {} (node {}): listen: no position for {} ms", node.axis.name,
                node.axis.node,
                std::chrono::duration_cast<std::chrono::milliseconds>(options_.silence).count()));
        configure(node, now);
        break;
    }
  }
}

void EncoderSupervisor::follow(Node& node, HostTime now) {
  if (node.configurator.state() == can::EncoderConfigurator::State::Ready) {
    node.state = State::Ready;
    node.ready_at = now;
    node.unanswered_sync.reset();
  } else if (node.configurator.state() == can::EncoderConfigurator::State::Failed) {
    node.state = State::Waiting;
    const auto& error = node.configurator.error();
    node.retry_at = is_final(error) ? HostTime::max() : now + options_.retry_after;
    report(node, error.fault, describe(node.axis, error));
  }
}

void EncoderSupervisor::report(Node& node, ConfigurationFault fault, std::string text) {
  if (node.reported != fault) faults_.push_back(std::move(text));
  node.reported = fault;
}

std::optional<can::CanFrame> EncoderSupervisor::take_frame() {
  if (!resets_.empty()) {
    const auto frame = resets_.front();
    resets_.erase(resets_.begin());
    return frame;
  }
  for (auto& node : nodes_) {
    if (const auto frame = node.configurator.take_frame()) return frame;
  }
  return std::nullopt;
}

std::optional<std::string> EncoderSupervisor::take_fault() {
  if (faults_.empty()) return std::nullopt;
  auto text = std::move(faults_.front());
  faults_.erase(faults_.begin());
  return text;
}

HostTime EncoderSupervisor::deadline() const {
  auto earliest = HostTime::max();
  for (const auto& node : nodes_) {
    const auto due = node.state == State::Waiting       ? node.retry_at
                     : node.state == State::Configuring ? node.configurator.deadline()
                     : node.unanswered_sync             ? *node.unanswered_sync + options_.silence
                                                        : HostTime::max();
    earliest = std::min(earliest, due);
  }
  return earliest;
}

std::size_t EncoderSupervisor::ready() const {
  const auto is_ready = [](const Node& node) { return node.state == State::Ready; };
  return static_cast<std::size_t>(std::count_if(nodes_.begin(), nodes_.end(), is_ready));
}

}  // namespace abbe::drivers
