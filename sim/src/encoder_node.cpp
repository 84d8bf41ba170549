#include "abbe/sim/encoder_node.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {
namespace {

constexpr std::uint32_t kVendor = 0;  // no vendor id is assigned to this simulated encoder
constexpr std::uint8_t kLastCyclicType = 240;
constexpr std::uint8_t kFirstEventType = 254;

can::EncoderIdentity identity_of(const EncoderNodeOptions& options) {
  can::EncoderIdentity identity;
  identity.node = options.node;
  identity.vendor = kVendor;
  identity.product = 406;
  identity.revision = 1;
  identity.serial = 1000u + options.node;
  if (std::holds_alternative<Axis>(options.axis)) {
    identity.name = "abbe-sim linear encoder";
    identity.step_nm = options.step_nm;
  } else {
    identity.name = "abbe-sim rotary encoder";
    identity.kind = can::object::EncoderKind::SingleTurn;
    identity.units_per_revolution = identity.total_range = options.units_per_revolution;
  }
  return identity;
}

/// Size of a step, m or rad.
double step_of(const EncoderNodeOptions& options) {
  const double size = std::holds_alternative<Axis>(options.axis)
                          ? 1e-9 * options.step_nm
                          : 2.0 * std::numbers::pi / options.units_per_revolution;
  return options.invert ? -size : size;
}

/// The count of a single-turn encoder: 0 to `units` - 1.
std::int64_t within_revolution(std::int64_t count, std::int64_t units) {
  const std::int64_t rest = count % units;
  return rest < 0 ? rest + units : rest;
}

}  // namespace

EncoderNode::EncoderNode(const EncoderNodeOptions& options, const VirtualMachine& machine,
                         HostTime now)
    : options_(options),
      machine_(machine),
      objects_(identity_of(options)),
      sdo_(options.node, objects_),
      boot_at_(now),
      last_heartbeat_(now) {}

std::chrono::nanoseconds EncoderNode::heartbeat_period() const {
  return std::chrono::milliseconds{objects_.number(can::object::kHeartbeatTime).value_or(0)};
}

void EncoderNode::send(const can::CanFrame& frame, HostTime at) {
  if (at < mute_until_) return;
  out_.push_back({at < delay_until_ ? at + delay_ : at, frame});
}

std::vector<TimedFrame> EncoderNode::take_frames() {
  return std::exchange(out_, {});
}

void EncoderNode::delay_until(HostTime until, std::chrono::nanoseconds delay) {
  delay_until_ = until;
  delay_ = delay;
}

void EncoderNode::boot(HostTime at, bool reset_objects) {
  if (reset_objects) objects_.reset();
  syncs_seen_ = {};
  state_ = can::NodeState::BootUp;
  boot_at_ = at + options_.boot_time;
}

/// Configures the node as a machine's control does: TPDO 1 at every SYNC, a heartbeat, operational.
void EncoderNode::configure() {
  constexpr std::uint64_t kEverySync = 1;
  constexpr std::uint64_t kHeartbeat_ms = 100;
  objects_.set_number({can::object::kTpdoParameters, 2}, kEverySync);
  objects_.set_number({can::object::kTpdoParameters, 5}, 0);
  objects_.set_number({can::object::kTpdoParameters + 1, 1},
                      can::cob::tpdo(2, options_.node) | can::object::kPdoDisabled);
  objects_.set_number(can::object::kHeartbeatTime, kHeartbeat_ms);
  state_ = can::NodeState::Operational;
}

void EncoderNode::restart(HostTime now) {
  boot(now, true);
}

void EncoderNode::emergency(std::uint16_t code, std::uint8_t error_register, HostTime now) {
  objects_.record_error(code, error_register);
  send(can::encode_emergency({options_.node, code, error_register, {}}), now);
}

void EncoderNode::on_frame(const can::CanFrame& frame, HostTime at) {
  advance(at);
  if (state_ == can::NodeState::BootUp) return;
  if (const auto nmt = can::decode_nmt(frame)) return on_nmt(*nmt, at);
  if (can::decode_sync(frame)) return on_sync(at);
  if (state_ == can::NodeState::Stopped) return;  // no SDO in state stopped [CiA 301]
  sample(at);
  if (const auto answer = sdo_.on_frame(frame, at)) send(*answer, at);
}

void EncoderNode::on_nmt(const can::NmtMessage& message, HostTime at) {
  if (message.node != can::kAllNodes && message.node != options_.node) return;
  switch (message.command) {
    case can::NmtCommand::Start:
      state_ = can::NodeState::Operational;
      break;
    case can::NmtCommand::Stop:
      state_ = can::NodeState::Stopped;
      break;
    case can::NmtCommand::PreOperational:
      state_ = can::NodeState::PreOperational;
      break;
    // Both commands reset the PDO configuration: this encoder does not store it in non-volatile
    // memory.
    case can::NmtCommand::ResetNode:
    case can::NmtCommand::ResetCommunication:
      boot(at, true);
      break;
  }
}

void EncoderNode::on_sync(HostTime at) {
  if (state_ != can::NodeState::Operational) return;
  sample(at);
  for (unsigned n = 1; n <= 2; ++n) {
    const can::TpdoSettings tpdo = objects_.tpdo(n);
    if (!tpdo.enabled || tpdo.transmission_type > kLastCyclicType) continue;
    const std::uint8_t every = std::max<std::uint8_t>(tpdo.transmission_type, 1);
    if (++syncs_seen_[n - 1] < every) continue;
    syncs_seen_[n - 1] = 0;
    send(objects_.tpdo_frame(n), at);
  }
}

void EncoderNode::sample(HostTime at) {
  const auto stream = static_cast<std::uint64_t>(NoiseStream::Encoder) + options_.node;
  const double noise = options_.noise * gaussian(options_.seed, stream, readings_++);
  const double measured = reading(options_.axis, machine_, at) + noise;
  const std::int64_t count = std::llround((measured - options_.offset) / step_of(options_));
  const bool linear = std::holds_alternative<Axis>(options_.axis);
  objects_.set_raw_position(linear ? count
                                   : within_revolution(count, options_.units_per_revolution));
}

void EncoderNode::advance(HostTime now) {
  if (state_ == can::NodeState::BootUp) {
    if (now < boot_at_) return;
    state_ = can::NodeState::PreOperational;
    last_heartbeat_ = boot_at_;
    last_event_.fill(boot_at_);
    send(can::encode_heartbeat(options_.node, can::NodeState::BootUp), boot_at_);
    if (options_.configured) configure();
  }

  if (const auto abort = sdo_.on_time(now)) send(*abort, now);
  const auto period = heartbeat_period();
  if (period.count() > 0 && now - last_heartbeat_ >= period) {
    last_heartbeat_ = now;
    send(can::encode_heartbeat(options_.node, state_), now);
  }

  if (state_ != can::NodeState::Operational) return;
  for (unsigned n = 1; n <= 2; ++n) {
    const can::TpdoSettings tpdo = objects_.tpdo(n);
    if (!tpdo.enabled || tpdo.transmission_type < kFirstEventType || tpdo.event_timer_ms == 0)
      continue;
    if (now - last_event_[n - 1] < std::chrono::milliseconds{tpdo.event_timer_ms}) continue;
    last_event_[n - 1] = now;
    sample(now);
    send(objects_.tpdo_frame(n), now);
  }
}

HostTime EncoderNode::next_due() const {
  if (state_ == can::NodeState::BootUp) return boot_at_;
  HostTime due = HostTime::max();
  if (heartbeat_period().count() > 0) due = last_heartbeat_ + heartbeat_period();
  if (state_ != can::NodeState::Operational) return due;
  for (unsigned n = 1; n <= 2; ++n) {
    const can::TpdoSettings tpdo = objects_.tpdo(n);
    if (!tpdo.enabled || tpdo.transmission_type < kFirstEventType || tpdo.event_timer_ms == 0)
      continue;
    due = std::min(due, last_event_[n - 1] + std::chrono::milliseconds{tpdo.event_timer_ms});
  }
  return due;
}

}  // namespace abbe::sim
