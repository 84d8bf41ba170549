#include "abbe/sim/recorded_bus.hpp"

#include <algorithm>
#include <utility>

#include "abbe/protocol/can/udp_framing.hpp"
#include "abbe/result/try.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

constexpr auto kBeat = 100ms;  // interval between heartbeats while nothing is replayed
constexpr std::uint32_t kFunction = 0x780;
constexpr std::uint32_t kNode = 0x07F;

bool is_function(const can::CanFrame& frame, std::uint32_t function) {
  return frame.is_standard_data() && (frame.id & kFunction) == function && (frame.id & kNode) != 0;
}
std::array<std::byte, 8> first_eight(const can::CanFrame& frame) {
  std::array<std::byte, 8> bytes{};
  std::copy_n(frame.data.begin(), bytes.size(), bytes.begin());
  return bytes;
}

}  // namespace

Result<RecordedBus> RecordedBus::open(const EncoderBusOptions& options,
                                      const RecordedDevice& device, ReplayTimeline& timeline,
                                      bool leads) {
  auto port = CanPort::open(options);
  ABBE_TRY(port);
  return RecordedBus(std::move(*port), device, timeline, leads);
}

RecordedBus::RecordedBus(std::unique_ptr<CanPort> port, const RecordedDevice& device,
                         ReplayTimeline& timeline, bool leads)
    : port_(std::move(port)), timeline_(timeline), leads_(leads) {
  for (const RecordedBlock& block : device.blocks) {
    auto view = can::DatagramView::parse(block.bytes);
    if (!view) continue;
    for (can::CanFrame frame; view->next(frame);) take(frame, block.to_device, block.time);
  }
  // the machine's control has started the nodes
  if (external()) state_ = can::NodeState::Operational;
}

void RecordedBus::take(const can::CanFrame& frame, bool to_device, HostTime time) {
  if (to_device) {
    if (can::decode_sync(frame)) {
      cycles_.push_back({time, {}});
      foreign_sync_ = false;
    }
    if (is_function(frame, can::cob::kSdoRequest)) {
      const auto node = static_cast<can::NodeId>(frame.id & kNode);
      if (const auto unanswered = asked_.find(node); unanswered != asked_.end())
        sdo_[unanswered->second].frames.push_back(std::nullopt);
      asked_[node] = {frame.id, first_eight(frame)};
    }
    return;
  }

  if (can::decode_sync(frame)) {
    ++foreign_syncs_;
    foreign_sync_ = true;
    unsolicited_.push_back({time, frame});
  } else if (can::cob::is_tpdo(frame) && foreign_sync_) {
    unsolicited_.push_back({time, frame});
  } else if (can::cob::is_tpdo(frame)) {
    if (!cycles_.empty()) cycles_.back().answers.push_back({time - cycles_.back().sync, frame});
  } else if (is_function(frame, can::cob::kSdoResponse)) {
    const auto asked = asked_.find(static_cast<can::NodeId>(frame.id & kNode));
    if (asked == asked_.end()) return;
    sdo_[asked->second].frames.push_back(frame);
    asked_.erase(asked);
  } else {
    if (const auto beat = can::decode_heartbeat(frame)) nodes_.insert(beat->node);
    unsolicited_.push_back({time, frame});
  }
}

void RecordedBus::poll(HostTime now) {
  for (const ArrivedFrame& arrived : port_->receive()) on_frame(arrived.frame, now);
  send_late(now);
  if (leads_ && external() && port_->has_listener())
    timeline_.start(unsolicited_.front().time, now);
  keep_alive(now);
  if (!timeline_.running()) next_unsolicited_ = 0;
  for (; next_unsolicited_ < unsolicited_.size() &&
         timeline_.due(unsolicited_[next_unsolicited_].time) <= now;
       ++next_unsolicited_) {
    // Frames whose time was before the start are skipped: keep_alive() has sent heartbeats instead.
    if (now - timeline_.due(unsolicited_[next_unsolicited_].time) < kOutOfStep)
      port_->send(std::span(&unsolicited_[next_unsolicited_].frame, 1));
  }
}

HostTime RecordedBus::next_due() const {
  const HostTime late = late_.empty() ? HostTime::max() : late_.front().time;
  if (!timeline_.running())
    return std::min(late, port_->has_listener() ? next_beat_ : HostTime::max());
  return std::min(late, next_unsolicited_ < unsolicited_.size()
                            ? timeline_.due(unsolicited_[next_unsolicited_].time)
                            : next_beat_);
}

void RecordedBus::keep_alive(HostTime now) {
  const bool over = next_unsolicited_ >= unsolicited_.size();
  if ((timeline_.running() && !over) || !port_->has_listener() || now < next_beat_) return;
  next_beat_ = now + kBeat;
  std::vector<can::CanFrame> beats;
  for (const can::NodeId node : nodes_) beats.push_back(can::encode_heartbeat(node, state_));
  port_->send(beats);
}

void RecordedBus::on_frame(const can::CanFrame& frame, HostTime now) {
  if (can::decode_sync(frame)) return on_sync(now);
  if (is_function(frame, can::cob::kSdoRequest)) return on_sdo(frame);
  const auto nmt = can::decode_nmt(frame);
  if (!nmt) return;
  if (nmt->command == can::NmtCommand::Start) state_ = can::NodeState::Operational;
  if (nmt->command == can::NmtCommand::Stop) state_ = can::NodeState::Stopped;
  if (nmt->command == can::NmtCommand::PreOperational) state_ = can::NodeState::PreOperational;
  if (nmt->command != can::NmtCommand::ResetNode &&
      nmt->command != can::NmtCommand::ResetCommunication)
    return;
  state_ = can::NodeState::PreOperational;
  if (timeline_.running() && next_unsolicited_ < unsolicited_.size())
    return;  // the recorded boot-up messages follow at their recorded time

  for (const can::NodeId node : nodes_) {
    if (nmt->node != can::kAllNodes && nmt->node != node) continue;
    const can::CanFrame boot = can::encode_heartbeat(node, can::NodeState::BootUp);
    port_->send(std::span(&boot, 1));
  }
}

std::size_t RecordedBus::cycle_at(HostTime recorded) const {
  const auto after =
      std::lower_bound(cycles_.begin(), cycles_.end(), recorded,
                       [](const Cycle& cycle, HostTime t) { return cycle.sync < t; });
  if (after == cycles_.begin()) return 0;
  if (after == cycles_.end()) return cycles_.size() - 1;
  const auto before = after - 1;
  return static_cast<std::size_t>(
      (recorded - before->sync < after->sync - recorded ? before : after) - cycles_.begin());
}

void RecordedBus::on_sync(HostTime now) {
  if (cycles_.empty()) return;
  if (leads_) timeline_.start(cycles_.front().sync, now);
  if (!timeline_.running()) {
    next_cycle_.reset();
    return answer(cycles_.front(), now);
  }
  const HostTime recorded = timeline_.recorded(now);
  std::size_t cycle = next_cycle_.value_or(cycle_at(recorded));
  const auto apart = cycles_[cycle].sync - recorded;
  if (apart > kOutOfStep || apart < -kOutOfStep) cycle = cycle_at(recorded);
  next_cycle_ = std::min(cycle + 1, cycles_.size() - 1);
  answer(cycles_[cycle], now);
}

/// Answers that came within 2 ms in the recording are sent at once: this response time is normal.
/// Later answers keep their delay, which is part of a recorded fault.
void RecordedBus::answer(const Cycle& cycle, HostTime now) {
  constexpr auto kAtOnce = 2ms;
  std::vector<can::CanFrame> at_once;
  for (const Answer& answer : cycle.answers) {
    if (answer.delay < kAtOnce) {
      at_once.push_back(answer.frame);
    } else {
      late_.push_back({now + answer.delay, answer.frame});
    }
  }
  std::ranges::stable_sort(late_, {}, &Unsolicited::time);
  port_->send(at_once);
}

void RecordedBus::send_late(HostTime now) {
  const auto due =
      std::ranges::find_if(late_, [now](const Unsolicited& s) { return s.time > now; });
  for (auto it = late_.begin(); it != due; ++it) port_->send(std::span(&it->frame, 1));
  late_.erase(late_.begin(), due);
}

void RecordedBus::on_sdo(const can::CanFrame& frame) {
  const auto known = sdo_.find({frame.id, first_eight(frame)});
  if (known == sdo_.end()) {
    // The request is not in the recording: SDO abort "general error" for the same object.
    const std::uint32_t id = can::cob::kSdoResponse + (frame.id & kNode);
    const can::CanFrame abort = can::standard_frame(
        id, {0x80, frame.byte(1), frame.byte(2), frame.byte(3), 0x00, 0x00, 0x00, 0x08});
    return port_->send(std::span(&abort, 1));
  }
  SdoResponses& responses = known->second;
  const auto& response = responses.frames[responses.next];
  if (response) port_->send(std::span(&*response, 1));
  if (responses.next + 1 < responses.frames.size()) ++responses.next;
}

}  // namespace abbe::sim
