// What the encoder device makes known of itself: faults, state and condition. What it does is in
// encoder_device.cpp.

#include <fmt/format.h>

#include <bit>
#include <utility>

#include "abbe/drivers/can/encoder_device.hpp"

namespace abbe::drivers {

using protocol::HostTime;

namespace {

constexpr auto kToldAgainAfter = std::chrono::seconds{1};

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
    board_.fault(now, fmt::format("CAN {}: read: {} datagrams that are no CAN frames", bus_->name(),
                                  bus.refused - bus_seen_.refused));
  }

  bus_seen_ = bus;
  missed_seen_ = missed;
  tell_of(kept_back_, kept_back_told_,
          "SYNCs not sent: the one before has not left, or its echo comes later than a SYNC period",
          now);

  if (bus.strangers != strangers_told_.count)
    tell_of(bus.strangers, strangers_told_,
            fmt::format("datagrams from {}, which is not the peer: refused", bus_->stranger()),
            now);
  tell_of(receiver_.counters().short_frames, shorts_told_, "frames too short for a position", now);
  tell_of_late_answers(now);
}

/// The cause, not what follows from it: a tunnel that bundles makes late and second answers.
void EncoderDevice::tell_of_late_answers(HostTime now) {
  tell_of(together_.count(), bundled_told_,
          "bundles of answers to several SYNCs: the tunnel holds frames back (cannelloni: give -t, "
          "in us, well "
          "below the SYNC period)",
          now);
  const auto& counters = receiver_.counters();

  if (bundled_told_.at && now - *bundled_told_.at < 2 * kToldAgainAfter) {
    duplicates_told_.count = counters.duplicate_frames;
    late_told_ = {counters.late_frames, now};
    return;
  }

  tell_of(counters.duplicate_frames, duplicates_told_,
          "second answers in a cycle: a node answers later than a SYNC period, a SYNC left late, "
          "the echo of a "
          "SYNC was lost, or two nodes have one number",
          now);
  tell_of_many_late(now);
}

/// A few late answers are lost cycles like any; many are how the bus is set up.
void EncoderDevice::tell_of_many_late(HostTime now) {
  constexpr std::uint64_t kMany = 20;
  const auto late = receiver_.counters().late_frames;
  if (!late_told_.at || now - *late_told_.at < kToldAgainAfter) {
    if (!late_told_.at) late_told_ = {late, now};
    return;
  }

  if (late - late_told_.count < kMany) {
    late_told_ = {late, now};
    return;
  }

  tell_of(late, late_told_,
          "answers after the end of their cycle: the tunnel (cannelloni -t) or the gateway holds "
          "them back, "
          "or the SYNC "
          "period is too short",
          now);
}

void EncoderDevice::tell_of(std::uint64_t count, Told& told, std::string_view what, HostTime now) {
  if (count == told.count || (told.at && now - *told.at < kToldAgainAfter)) return;
  board_.faults.add(count - told.count - 1);
  board_.fault(now, fmt::format("CAN {}: read: {} {}", bus_->name(), count - told.count, what));
  told = {count, now};
}

void EncoderDevice::show_state(HostTime now) {
  if (!open_) return;
  const bool heard = last_heard_ != HostTime{} && now - last_heard_ < options_.supervisor.silence;
  board_.set_connected(heard && !bus_off() && (external() || sending_));
  board_.set_state(state_text(now));
  show_condition(now);
}

/// While nothing is asked of the nodes the state says it all.
void EncoderDevice::show_condition(HostTime now) {
  const bool asked = !bus_off() && (external() ? foreign_.present() && !no_sync_told_ : sending_);
  auto text = asked ? emergencies_.condition(presence_.absent(), now) : std::string{};
  if (text == condition_) return;
  board_.set_condition(now, text);
  condition_ = std::move(text);
}

const char* EncoderDevice::state_text(HostTime now) const {
  if (bus_off()) return "bus off";
  const auto absent = presence_.absent();
  const bool all_absent = std::popcount(absent) == static_cast<int>(supervisor_.nodes());

  if (external()) {
    if (no_sync_told_) return "no SYNC";
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
