// Status of the encoder device: faults, state and condition. Its operation is in
// encoder_device.cpp.

#include <fmt/format.h>

#include <bit>
#include <utility>

#include "abbe/drivers/can/encoder_device.hpp"

namespace abbe::drivers {

using protocol::HostTime;

namespace {

constexpr auto kRepeatReportAfter = std::chrono::seconds{1};

}  // namespace

void EncoderDevice::account(HostTime now) {
  while (const auto text = supervisor_.take_fault()) board_.fault(now, *text);
  while (const auto text = emergencies_.take_fault(now)) board_.fault(now, *text);
  const auto bus = bus_->counters();
  const auto missed = receiver_.counters().missed_syncs;
  board_.gaps.add(bus.lost - bus_seen_.lost + missed - missed_seen_);
  board_.time_widened.add(bus.time_widened - bus_seen_.time_widened);

  if (bus.refused != bus_seen_.refused) {
    board_.faults.add(bus.refused - bus_seen_.refused - 1);
    board_.fault(now, fmt::format("CAN {}: read: {} datagrams without valid CAN frames",
                                  bus_->name(), bus.refused - bus_seen_.refused));
  }

  bus_seen_ = bus;
  missed_seen_ = missed;
  report_count(withheld_syncs_, withheld_reported_,
               "SYNCs not sent: the previous SYNC was not transmitted, or its echo took longer "
               "than a SYNC period",
               now);

  if (bus.foreign_datagrams != strangers_reported_.count)
    report_count(
        bus.foreign_datagrams, strangers_reported_,
        fmt::format("datagrams from {}, which is not the peer: refused", bus_->foreign_sender()),
        now);
  report_count(receiver_.counters().short_frames, shorts_reported_,
               "frames too short for a position", now);
  report_late_answers(now);
}

/// Reports bundles of answers, or else late and second answers. A tunnel that bundles frames causes
/// all three, so only the bundles are reported.
void EncoderDevice::report_late_answers(HostTime now) {
  report_count(together_.count(), bundled_reported_,
               fmt::format("bundles of answers to several SYNCs: {}", options_.delay_advice), now);
  const auto& counters = receiver_.counters();

  if (bundled_reported_.at && now - *bundled_reported_.at < 2 * kRepeatReportAfter) {
    duplicates_reported_.count = counters.duplicate_frames;
    late_reported_ = {counters.late_frames, now};
    return;
  }

  report_count(counters.duplicate_frames, duplicates_reported_,
               "second answers in a cycle: a node answers later than a SYNC period, a SYNC was "
               "transmitted late, the echo of a SYNC was lost, or two nodes have the same node ID",
               now);
  report_many_late(now);
}

/// Reports late answers only if they are many, because many late answers have a cause in the set-up
/// of the bus. A few are only counted.
void EncoderDevice::report_many_late(HostTime now) {
  constexpr std::uint64_t kMany = 20;
  const auto late = receiver_.counters().late_frames;
  if (!late_reported_.at || now - *late_reported_.at < kRepeatReportAfter) {
    if (!late_reported_.at) late_reported_ = {late, now};
    return;
  }

  if (late - late_reported_.count < kMany) {
    late_reported_ = {late, now};
    return;
  }

  report_count(
      late, late_reported_,
      "answers after the end of their cycle: the tunnel (cannelloni -t) or the gateway delays "
      "them, or the SYNC period is too short",
      now);
}

void EncoderDevice::report_count(std::uint64_t count, Reported& reported, std::string_view what,
                                 HostTime now) {
  if (count == reported.count || (reported.at && now - *reported.at < kRepeatReportAfter)) return;
  board_.faults.add(count - reported.count - 1);
  board_.fault(now, fmt::format("CAN {}: read: {} {}", bus_->name(), count - reported.count, what));
  reported = {count, now};
}

void EncoderDevice::show_state(HostTime now) {
  if (!open_) return;
  const bool heard = last_heard_ != HostTime{} && now - last_heard_ < options_.supervisor.silence;
  board_.set_connected(heard && !bus_off() && (external() || sending_));
  board_.set_state(state_text(now));
  show_condition(now);
}

/// Shows the condition of the axes. It is empty while the nodes are not polled: the state then
/// names the reason.
void EncoderDevice::show_condition(HostTime now) {
  const bool polled =
      !bus_off() && (external() ? foreign_.present() && !no_sync_reported_ : sending_);
  auto text = polled ? emergencies_.condition(presence_.absent(), now) : std::string{};
  if (text == condition_) return;
  board_.set_condition(now, text);
  condition_ = std::move(text);
}

const char* EncoderDevice::state_text(HostTime now) const {
  if (bus_off()) return "bus off";
  const auto absent = presence_.absent();
  const bool all_absent = std::popcount(absent) == static_cast<int>(supervisor_.nodes());

  if (external()) {
    if (no_sync_reported_) return "no SYNC";
    if (!foreign_.present()) return "listening";
    return absent == 0 ? "streaming" : all_absent ? "silent" : "degraded";
  }

  if (!sending_) return foreign_.present() ? "foreign SYNC" : "listening";
  const auto ready = supervisor_.ready();
  if (ready == supervisor_.nodes() && absent == 0) return "streaming";
  if (ready > 0) return "degraded";
  const bool heard = last_heard_ != HostTime{} && now - last_heard_ < options_.supervisor.silence;

  return heard || last_heard_ == HostTime{} ? "configuring" : "silent";
}

}  // namespace abbe::drivers
