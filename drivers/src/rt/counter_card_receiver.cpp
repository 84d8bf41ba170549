#include "abbe/drivers/counter_card/receiver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace abbe::drivers {
namespace {

using protocol::SampleFlag;

/// Longest time from a gap in the scans until the clock model detects a jump of the card's clock:
/// no batch of scans waits longer in the host.
constexpr double kJumpSeenWithin_s = 1.0;

/// Limits of the difference between the card's clock and the host's after an interruption, if the
/// card's clock has continued. It may appear behind by the delay of the newest batch of scans (busy
/// host), and ahead by the error of the clock model. Both limits are extended by twice the rate
/// error between the two clocks.
constexpr double kLatest_s = 3.0;
constexpr double kMostAhead_s = 1.0;
constexpr double kLargestDrift = 1e-3;
/// Largest interval between the two limits, as a fraction of the clock counter's range. With a
/// wider interval, a counter that restarted would often be accepted by chance.
constexpr double kWidestInterval = 0.02;

/// The corresponding limits for counters of an earlier run of the program. Both instants come from
/// arrivals with little delay: the earlier one from a settled clock model, the present one from the
/// least delayed of many arrivals. The remaining tolerance is the clock model's limit of a jump
/// plus its limit of the rate error times the time between.
constexpr double kResumedWithin_s = std::chrono::duration<double>(ClockModelOptions{}.jump).count();
constexpr double kResumedDrift = ClockModelOptions{}.max_skew;
constexpr double kResumedShown_s = 0.25;    // enough time to process the backlog of a delayed host
constexpr double kResumedPatience_s = 3.0;  // same value as kLatest_s
/// Same as kWidestInterval, for counters of an earlier run. It is smaller because no process
/// observed the card between the two runs: its counters may have been set up again shortly after
/// the first run.
constexpr double kWidestResumed = 0.005;

std::uint32_t saturated(std::uint64_t n) ABBE_RT {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(n, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

bool CounterCardReceiver::clock_fits(const quad08::RawScan& from,
                                     const quad08::RawScan& to) const ABBE_RT {
  return metronome_.beats(from[metronome_.place], to[metronome_.place], width_);
}

protocol::DeviceTime CounterCardReceiver::device_time(std::int64_t clock_count) const ABBE_RT {
  // Whole seconds are converted separately: a double loses nanoseconds after weeks.
  const double whole = std::floor(static_cast<double>(clock_count) / clock_hz_);
  const double rest = static_cast<double>(clock_count) - whole * clock_hz_;
  return protocol::DeviceTime{std::chrono::seconds{static_cast<std::int64_t>(whole)} +
                              std::chrono::nanoseconds{std::llround(rest / clock_hz_ * 1e9)}};
}

void CounterCardReceiver::on_control(const protocol::usb::Setup& setup) ABBE_RT {
  if (setup == quad08::read_firmware_version()) reopened_ = last_.has_value();
  if (quad08::is_write(setup, quad08::Register::CounterSetup)) counters_zeroed();
  const bool transfer = quad08::is_write(setup, quad08::Register::DmaControl);
  if (transfer && setup.value == quad08::dma::kChannel1On) stream_began();
}

void CounterCardReceiver::counters_zeroed() ABBE_RT {
  last_.reset();
  candidate_.reset();
  clock_.reset();
  latch_.reset();
  long_gap_.reset();
  zeroed_ = true;
  reopened_ = false;
  resumption_.reset();
  current_.clock_count = current_.latch_count = current_.latch_half_width = current_.edge_count = 0;
  current_.latched = false;
  pending_flags_ = static_cast<protocol::SampleFlags>(SampleFlag::Restarted);
}

void CounterCardReceiver::stream_began() ABBE_RT {
  decoder_.reset();
  pending_ = {};
  seeking_ = out_of_step_ = false;
  window_filled_ = 0;
  candidate_.reset();
  refused_run_ = 0;
  stream_restarted_ = last_.has_value();
  if (resumption_) resumption_ = Resumption{.since = resumption_->since, .begun = {}};
}

void CounterCardReceiver::bytes_lost() ABBE_RT {
  stream_began();
  seeking_ = true;
  raw_filled_ = 0;
}

void CounterCardReceiver::push(std::span<const std::byte> bytes,
                               protocol::HostTime arrival) ABBE_RT {
  arrival_ = arrival;
  if (!out_of_step_) pending_ = bytes;
}

std::span<const CounterScan> CounterCardReceiver::next() ABBE_RT {
  scan_count_ = 0;
  // One raw scan gives at most two scans: the one held back before it, and itself.
  while (scan_count_ + 2 <= scans_.size() && !out_of_step_) {
    const auto raw = next_raw();
    if (!raw) break;
    take(*raw);
  }
  stamp();
  return std::span{scans_}.first(scan_count_);
}

std::optional<quad08::RawScan> CounterCardReceiver::next_raw() ABBE_RT {
  if (auto scan = decoder_.next()) return scan;
  if (seeking_) {
    seek();
    if (auto scan = decoder_.next()) return scan;  // from the window; pending_ is used afterwards
  }
  if (seeking_ || pending_.empty()) return std::nullopt;
  decoder_.push(std::exchange(pending_, {}));
  return decoder_.next();
}

/// Moves bytes into window_ until they show the beginning of a scan, or all bytes are moved.
void CounterCardReceiver::seek() ABBE_RT {
  const std::size_t needed = quad08::seek_window(decoder_.layout());
  while (!pending_.empty()) {
    const std::size_t more = std::min(needed - window_filled_, pending_.size());
    std::copy_n(pending_.begin(), more,
                window_.begin() + static_cast<std::ptrdiff_t>(window_filled_));
    pending_ = pending_.subspan(more);
    window_filled_ += more;
    if (window_filled_ < needed) return;
    const auto window = std::span{window_}.first(window_filled_);
    if (const auto begin = quad08::seek_scan(window, decoder_.layout(), metronome_)) {
      decoder_.reset();
      decoder_.push(window.subspan(*begin));
      window_filled_ = 0;
      seeking_ = false;
      return;
    }
    // No scan begins at the offsets that were tried: continue after the last of them.
    const std::size_t tried = decoder_.layout().scan_bytes();
    std::copy(window.begin() + static_cast<std::ptrdiff_t>(tried), window.end(), window_.begin());
    window_filled_ -= tried;
  }
}

void CounterCardReceiver::take(const quad08::RawScan& raw) ABBE_RT {
  if (candidate_ && clock_fits(*candidate_, raw)) {
    const quad08::RawScan confirmed = *candidate_;
    candidate_.reset();
    accept(confirmed);
    accept(raw);
    refused_run_ = 0;
  } else if (candidate_) {
    refuse(*candidate_, raw);
  } else if (last_ && !stream_restarted_ && clock_fits(*last_, raw)) {
    accept(raw);
  } else {
    candidate_ = raw;
  }
}

void CounterCardReceiver::refuse(const quad08::RawScan& from, const quad08::RawScan& to) ABBE_RT {
  ++counters_.refused_scans;
  refused_step_ = quad08::upward_step(from[metronome_.place], to[metronome_.place], width_);
  candidate_ = to;
  out_of_step_ = ++refused_run_ >= kMostRefused;
}

void CounterCardReceiver::accept(const quad08::RawScan& raw) ABBE_RT {
  const bool resuming = resumption_.has_value();
  if (resuming && !resumed(raw)) {
    ++counters_.withheld_scans;
    return;
  }
  CounterScan& scan = scans_[scan_count_++];
  current_.axes.head.flags = std::exchange(pending_flags_, 0);
  current_.axes.head.lost_before = 0;
  if (current_.axes.missing_mask != 0) current_.axes.head.flags |= SampleFlag::AxisMissing;
  if (last_ && stream_restarted_ && !resuming) judge_first_scan(raw);

  if (last_) {
    const auto& from = (*last_)[metronome_.place];
    const auto wrapped = clock_wraps_ * quad08::modulus_of(width_);
    count_lost(quad08::upward_step(from, raw[metronome_.place], width_) + wrapped, current_);
  }

  unwrap(raw, current_);
  clock_wraps_ = 0;
  last_ = raw;
  ++counters_.scans;
  scan = current_;
}

/// Called for the first scan of a stream. Only a card that was opened again may have restarted. The
/// counters of a card that stayed open have continued, even after a long delay of the host.
void CounterCardReceiver::judge_first_scan(const quad08::RawScan& raw) ABBE_RT {
  const bool same = goes_on(raw);
  if (std::exchange(reopened_, false) && !same) restart();
}

/// True if the counters have continued since the last scan: the clock channel agrees with the
/// host's clock within the limits. A counter of 32 bits may have wrapped. The instant of the last
/// scan comes from the clock model, because its batch may have arrived late; before the model is
/// settled this instant may be late as well.
bool CounterCardReceiver::goes_on(const quad08::RawScan& raw) ABBE_RT {
  const auto before = clock_.to_host(device_time(current_.clock_count));
  const double elapsed_s = std::chrono::duration<double>(arrival_ - before.time).count();
  const double behind_s = seconds_behind(raw, before.time);
  const double most_behind_s = kLatest_s + kLargestDrift * elapsed_s;
  const double most_ahead_s =
      (before.settled ? kMostAhead_s : kLatest_s) + kLargestDrift * elapsed_s;
  const double range_s = static_cast<double>(quad08::modulus_of(width_)) / clock_hz_;
  behind_s_ = std::remainder(behind_s, range_s);  // for messages; the wraps are not known
  if (most_behind_s + most_ahead_s > kWidestInterval * range_s) return false;
  return behind_s <= most_behind_s && -behind_s <= most_ahead_s;
}

/// Time by the host's clock minus time by the clock channel, both since the last scan at `since`,
/// s. Takes wraps of the clock channel into account.
double CounterCardReceiver::seconds_behind(const quad08::RawScan& raw,
                                           protocol::HostTime since) ABBE_RT {
  const double elapsed_s = std::chrono::duration<double>(arrival_ - since).count();
  const auto range = static_cast<double>(quad08::modulus_of(width_));
  const auto step = static_cast<double>(
      quad08::upward_step((*last_)[metronome_.place], raw[metronome_.place], width_));
  const double wraps = std::max(0.0, std::round((elapsed_s * clock_hz_ - step) / range));
  clock_wraps_ = static_cast<std::uint64_t>(wraps);
  return elapsed_s - (wraps * range + step) / clock_hz_;
}

/// True once the counters of the earlier run are known to have continued. An arrival is never
/// early, only late: the least delayed arrival bounds how far the clock channel is behind the
/// host's clock. If an arrival shows the clock channel ahead by more than the tolerance, the
/// counters have not continued.
bool CounterCardReceiver::resumed(const quad08::RawScan& raw) ABBE_RT {
  Resumption& r = *resumption_;
  if (r.refused) return false;
  const double behind_s = seconds_behind(raw, r.since);
  r.least_behind_s = r.begun ? std::min(r.least_behind_s, behind_s) : behind_s;
  if (!r.begun) r.begun = arrival_;

  const double elapsed_s = std::chrono::duration<double>(arrival_ - r.since).count();
  const double shown_s = std::chrono::duration<double>(arrival_ - *r.begun).count();
  const double within_s = kResumedWithin_s + kResumedDrift * std::max(0.0, elapsed_s);
  const double range_s = static_cast<double>(quad08::modulus_of(width_)) / clock_hz_;
  const bool too_long = 2.0 * within_s > kWidestResumed * range_s;
  const bool behind = r.least_behind_s > within_s;
  r.refused = elapsed_s < 0.0 || too_long || r.least_behind_s < -within_s ||
              (behind && shown_s >= kResumedPatience_s);
  if (r.refused) {
    behind_s_ = std::remainder(r.least_behind_s, range_s);
    ++counters_.restarted;
  }
  if (r.refused || behind || shown_s < kResumedShown_s) return false;
  take_over(raw);
  return true;
}

/// Accepts the counters of the earlier run as continued. Their edge count was not stored, so edges
/// since that run are not reported.
void CounterCardReceiver::take_over(const quad08::RawScan& raw) ABBE_RT {
  if (edge_place_) (*last_)[*edge_place_] = raw[*edge_place_];
  if (latch_place_) latch_.begin_at(raw[*latch_place_]);
  resumption_.reset();
  reopened_ = false;
}

/// The counters have restarted without a set-up: all states are reset as after a set-up, but the
/// present counts are unknown.
void CounterCardReceiver::restart() ABBE_RT {
  ++counters_.restarted;
  counters_zeroed();
  zeroed_ = stream_restarted_ = false;
  clock_wraps_ = 0;
  current_.axes.head.flags |= std::exchange(pending_flags_, 0);
}

void CounterCardReceiver::count_lost(std::uint64_t clock_step, CounterScan& scan) ABBE_RT {
  const auto periods = static_cast<std::uint64_t>(
      std::max(1.0, std::round(static_cast<double>(clock_step) / metronome_.step)));
  scan.axes.cycle += saturated(periods);
  const bool restarted = std::exchange(stream_restarted_, false);
  if (periods == 1 && !restarted) return;
  const std::uint64_t lost = std::max<std::uint64_t>(periods - 1, 1);
  ++counters_.gaps;
  counters_.lost_scans += lost;
  scan.axes.head.lost_before = saturated(lost);
  scan.axes.head.flags |= SampleFlag::GapBefore;
  const double gap_s = static_cast<double>(lost) * metronome_.step / clock_hz_;
  // Half of the jump that the clock model detects: that detection has a tolerance.
  if (gap_s >= 0.5 * std::chrono::duration<double>(ClockModelOptions{}.jump).count())
    keep_gap({scan.clock_count + static_cast<std::int64_t>(clock_step), gap_s});
}

/// Keeps the longest recent gap: after a restart of the card a shorter gap can follow before the
/// restart is detected.
void CounterCardReceiver::keep_gap(const LongGap& gap) ABBE_RT {
  const bool longer_before = long_gap_ && long_gap_->length_s >= gap.length_s &&
                             seconds_since(*long_gap_, gap.clock_count) < kJumpSeenWithin_s;
  if (!longer_before) long_gap_ = gap;
}

double CounterCardReceiver::seconds_since(const LongGap& gap,
                                          std::int64_t clock_count) const ABBE_RT {
  return static_cast<double>(clock_count - gap.clock_count) / clock_hz_;
}

void CounterCardReceiver::unwrap(const quad08::RawScan& raw, CounterScan& scan) ABBE_RT {
  const quad08::RawScan zeros{};
  const auto& from = last_ ? *last_ : zeros;
  const std::int64_t previous_clock = scan.clock_count;
  const std::size_t clock = metronome_.place;
  scan.clock_count +=
      static_cast<std::int64_t>(quad08::upward_step(from[clock], raw[clock], width_) +
                                clock_wraps_ * quad08::modulus_of(width_));
  for (std::size_t i = 0; i < scan.axes.axis_count; ++i) {
    const Axis& axis = axes_[i];
    const std::int64_t before = last_ ? scan.axes.count[i] : 0;
    scan.axes.count[i] = before + quad08::signed_step(from[axis.place], raw[axis.place], width_);
    scan.axes.position[i] = axis.offset + static_cast<double>(scan.axes.count[i]) * axis.scale;
  }
  if (edge_place_) {
    scan.edge_count += static_cast<std::int64_t>(
        quad08::upward_step(from[*edge_place_], raw[*edge_place_], width_));
  }
  if (latch_place_) follow_latch(raw, previous_clock, scan);
}

void CounterCardReceiver::follow_latch(const quad08::RawScan& raw, std::int64_t previous_clock,
                                       CounterScan& scan) ABBE_RT {
  const auto reading = raw[*latch_place_];
  if (!last_ && !zeroed_) return latch_.begin_at(reading);
  if (!latch_.on_scan(reading, raw[metronome_.place], scan.clock_count, previous_clock)) return;
  ++counters_.edges;
  counters_.latch_disagreements = latch_.disagreements();
  scan.latched = true;
  scan.latch_count = latch_.latest()->clock_count;
  scan.latch_half_width = latch_.latest()->half_width;
}

/// Dates the scans of a batch. The last scan has the smallest delay to the arrival of the batch: it
/// updates the clock model.
void CounterCardReceiver::stamp() ABBE_RT {
  if (scan_count_ == 0) return;
  const auto youngest = device_time(scans_[scan_count_ - 1].clock_count);
  const auto scans = std::span{scans_}.first(scan_count_);
  const std::chrono::duration<double> ahead = clock_.to_host(youngest).time - arrival_;
  if (clock_.observe(youngest, arrival_) == ClockModel::Observed::Restarted) {
    ++counters_.clock_jumps;
    mark_restart(scans, ahead.count());
  }
  for (auto& scan : scans) {
    const auto at = clock_.to_host(device_time(scan.clock_count));
    scan.axes.head.time = at.time;
    scan.axes.head.u_time = at.u_time;
    if (!at.settled) scan.axes.head.flags |= SampleFlag::ClockUnsettled;
  }
}

/// The clock model has detected a jump of the card's clock. Without a long gap in the scans the
/// counters have continued, and only the clock model restarts. With a gap in this batch, the card
/// was restarted. A late batch can hide the jump for a while: then the gap was in an earlier batch
/// and is at least as long as the clock is ahead. If the clock is behind, the batches before were
/// late for a long time: no restart.
void CounterCardReceiver::mark_restart(std::span<CounterScan> scans, double ahead_s) ABBE_RT {
  const auto gap = std::exchange(long_gap_, std::nullopt);
  if (!gap) return;
  const auto after = std::ranges::find(scans, gap->clock_count, &CounterScan::clock_count);
  const double since_s = seconds_since(*gap, scans.back().clock_count);
  if (after != scans.end()) {
    after->axes.head.flags |= SampleFlag::Restarted;
  } else if (ahead_s > 0.0 && since_s < kJumpSeenWithin_s && gap->length_s >= ahead_s) {
    scans.front().axes.head.flags |= SampleFlag::Restarted;
  }
}

bool CounterCardReceiver::join(const protocol::RawBlock& block) ABBE_RT {
  if (block.lost_before != 0) bytes_lost();
  const auto part =
      std::span{block.bytes}.first(std::min<std::size_t>(block.length, block.bytes.size()));
  if (part.size() > raw_.size() - raw_filled_) {
    bytes_lost();
    return false;
  }
  std::copy(part.begin(), part.end(), raw_.begin() + static_cast<std::ptrdiff_t>(raw_filled_));
  raw_filled_ += part.size();
  return !block.continued && on_raw_message(block.direction, block.time);
}

bool CounterCardReceiver::on_raw_message(protocol::RawBlock::Direction direction,
                                         protocol::HostTime time) ABBE_RT {
  const auto message = std::span<const std::byte>{raw_}.first(std::exchange(raw_filled_, 0));
  if (message.size() < protocol::usbip::kUrbHeaderSize) return false;
  const auto urb = protocol::usbip::decode_urb(message.first<protocol::usbip::kUrbHeaderSize>());
  if (!urb) return false;
  const auto* request = std::get_if<protocol::usbip::Submit>(&*urb);
  const auto* answer = std::get_if<protocol::usbip::SubmitReply>(&*urb);
  const bool sent = direction == protocol::RawBlock::Direction::ToDevice;
  if (sent && request != nullptr && request->head.endpoint == 0) {
    on_control(protocol::usb::decode_setup(request->setup));
  }
  if (sent || answer == nullptr || answer->head.endpoint == 0) return false;
  push(message.subspan(protocol::usbip::kUrbHeaderSize), time);
  return true;
}

}  // namespace abbe::drivers
