#include "abbe/sim/encoder_bus.hpp"

#include <algorithm>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::sim {
namespace {

constexpr std::uint16_t kGenericEmergency = 0x1000;
constexpr double kTunnelTimeout_s = 0.1;  // cannelloni's default

bool concerns(const Fault& fault, const EncoderNode& node) {
  return fault.node == 0 || fault.node == node.node();
}

}  // namespace

Result<EncoderBus> EncoderBus::open(const EncoderBusOptions& options,
                                    std::span<const EncoderNodeOptions> nodes,
                                    const VirtualMachine& machine, HostTime now) {
  auto port = CanPort::open(options);
  ABBE_TRY(port);
  EncoderBus bus(std::move(*port));
  for (const EncoderNodeOptions& node : nodes) bus.nodes_.emplace_back(node, machine, now);
  return bus;
}

void EncoderBus::produce_sync(std::chrono::nanoseconds period, HostTime first) {
  sync_period_ = period;
  next_sync_ = first;
}

/// Sends at most one SYNC: a missed SYNC is not sent later.
void EncoderBus::send_sync(HostTime now) {
  if (now < next_sync_) return;
  const HostTime at = next_sync_ + sync_period_ * ((now - next_sync_) / sync_period_);
  next_sync_ = at + sync_period_;
  waiting_.push_back({at, can::encode_sync()});
  std::ranges::stable_sort(waiting_, {}, &TimedFrame::due);
  if (bus_off_until_) return;
  for (EncoderNode& node : nodes_) node.on_frame(can::encode_sync(), at);
  collect();
}

void EncoderBus::poll(HostTime now) {
  end_bus_off(now);
  receive(now);
  send_sync(now);
  for (EncoderNode& node : nodes_) node.advance(now);

  std::erase_if(all_clears_, [&](const AllClear& clear) {
    if (now < clear.due) return false;
    for (EncoderNode& node : nodes_) {
      if (node.node() == clear.node) node.emergency(0, 0, now);
    }
    return true;
  });

  collect();
  send_due(now);
}

HostTime EncoderBus::next_due() const {
  HostTime due = waiting_.empty() ? HostTime::max() : waiting_.front().due;
  if (!waiting_.empty() && due < next_bundle_ && due < bundle_until_)
    due = std::min(next_bundle_, bundle_until_);
  for (const EncoderNode& node : nodes_) due = std::min(due, node.next_due());
  for (const AllClear& clear : all_clears_) due = std::min(due, clear.due);
  if (bus_off_until_) due = std::min(due, *bus_off_until_);
  return std::min(due, next_sync_);
}

void EncoderBus::receive(HostTime now) {
  for (const ArrivedFrame& arrived : port_->receive()) {
    ++frames_received_;
    if (bus_off_until_) continue;
    for (EncoderNode& node : nodes_) node.on_frame(arrived.frame, now - arrived.age);
    collect();
  }
}

void EncoderBus::collect() {
  for (EncoderNode& node : nodes_) {
    for (const TimedFrame& timed : node.take_frames()) {
      const auto place =
          std::upper_bound(waiting_.begin(), waiting_.end(), timed.due,
                           [](HostTime due, const TimedFrame& t) { return due < t.due; });
      waiting_.insert(place, timed);
    }
  }
}

void EncoderBus::send_due(HostTime now) {
  if (now < bundle_until_) {
    if (now < next_bundle_) return;
    next_bundle_ = now + bundle_every_;
  }
  const auto end = std::find_if(waiting_.begin(), waiting_.end(),
                                [now](const TimedFrame& timed) { return timed.due > now; });
  if (!bus_off_until_) {
    std::vector<can::CanFrame> frames;
    for (auto it = waiting_.begin(); it != end; ++it) frames.push_back(it->frame);
    port_->send(frames);
  }
  waiting_.erase(waiting_.begin(), end);
}

void EncoderBus::send_error_frame(can::BusCondition condition) {
  can::BusReport report;
  report.conditions = static_cast<can::BusConditions>(condition);
  const can::CanFrame frame = can::encode_error_frame(report);
  port_->send(std::span(&frame, 1));
}

void EncoderBus::end_bus_off(HostTime now) {
  if (!bus_off_until_ || now < *bus_off_until_) return;
  bus_off_until_.reset();
  send_error_frame(can::BusCondition::Restarted);
}

void EncoderBus::inject(const Fault& fault, HostTime now) {
  const HostTime until = now + seconds_to_ns(fault.duration_s);
  if (fault.kind == FaultKind::BusOff) {
    send_error_frame(can::BusCondition::BusOff);
    bus_off_until_ = until;
    return;
  }

  if (fault.kind == FaultKind::BusGarbage) return port_->send_garbage();
  if (fault.kind == FaultKind::Overflow)
    return send_error_frame(can::BusCondition::ReceiveOverflow);

  if (fault.kind == FaultKind::Bundled) {
    bundle_until_ = until;
    bundle_every_ = seconds_to_ns(fault.value > 0.0 ? fault.value : kTunnelTimeout_s);
    next_bundle_ = now + bundle_every_;
    return;
  }

  for (EncoderNode& node : nodes_) {
    if (!concerns(fault, node)) continue;
    switch (fault.kind) {
      case FaultKind::Mute:
        node.mute_until(until);
        break;
      case FaultKind::Late:
        node.delay_until(until, seconds_to_ns(fault.value));
        break;
      case FaultKind::Restart:
        node.restart(now);
        break;
      case FaultKind::Emergency:
        node.emergency(
            fault.value > 0.0 ? static_cast<std::uint16_t>(fault.value) : kGenericEmergency, 1,
            now);
        all_clears_.push_back({until, node.node()});
        break;
      default:
        break;  // this is not a fault of an encoder
    }
  }

  collect();
  send_due(now);
}

}  // namespace abbe::sim
