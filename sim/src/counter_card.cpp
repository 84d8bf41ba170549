// The counters and the stream of scans; the requests are in counter_card_requests.cpp.
#include "abbe/sim/counter_card.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/quad08/stream.hpp"
#include "abbe/sim/noise.hpp"

namespace abbe::sim {
namespace {

constexpr std::size_t kEdgesKept = 64;  // later scans need no older edges

/// Whole periods of a clock since the epoch of host time.
std::int64_t clock_count(const ClockSignal& clock, HostTime at) {
  const double hz = clock.hz * (1.0 + 1e-6 * clock.deviation_ppm);
  const auto since = at.time_since_epoch();
  const auto whole = std::chrono::floor<std::chrono::seconds>(since);
  const double rest_s = ns_to_seconds(since - whole);
  const double whole_counts = static_cast<double>(whole.count()) * hz;
  return static_cast<std::int64_t>(std::floor(whole_counts + rest_s * hz));
}

}  // namespace

CounterCard::CounterCard(const CounterCardOptions& options) : options_(options) {}

HostTime CounterCard::scan_time(std::uint64_t scan) const {
  const double period_ns =
      1e9 / quad08::pacer_rate_hz(divisor_) * (1.0 - 1e-6 * options_.pacer_deviation_ppm);
  return pacer_began_ +
         std::chrono::nanoseconds{std::llround(static_cast<double>(scan) * period_ns)};
}

void CounterCard::advance(HostTime now, std::size_t wanted) {
  const std::size_t scan_bytes = layout_.scan_bytes();
  if (scan_bytes == 0) return;
  while (scanning() && scan_time(next_scan_) <= now) {
    if (fifo_.size() + scan_bytes > options_.fifo_bytes + wanted) {
      overrun_ = true;
      return;
    }
    make_scan(scan_time(next_scan_++));
  }
}

HostTime CounterCard::available_at(std::size_t bytes) const {
  if (!scanning() || layout_.scan_bytes() == 0) return HostTime::max();
  const std::size_t missing = bytes > fifo_.size() ? bytes - fifo_.size() : 0;
  const std::size_t scans = (missing + layout_.scan_bytes() - 1) / layout_.scan_bytes();
  return scans == 0 ? HostTime::min() : scan_time(next_scan_ + scans - 1);
}

std::vector<std::byte> CounterCard::take(std::size_t most) {
  const auto end = fifo_.begin() + static_cast<std::ptrdiff_t>(std::min(most, fifo_.size()));
  std::vector<std::byte> bytes(fifo_.begin(), end);
  fifo_.erase(fifo_.begin(), end);
  return bytes;
}

void CounterCard::make_scan(HostTime at) {
  std::array<std::byte, quad08::kChannels * sizeof(std::uint64_t)> bytes;  // NOLINT: written below
  protocol::ByteWriter out{bytes};
  for (const auto channel : layout_.used()) {
    const std::uint64_t value = value_of(channel, at);
    if (layout_.width == quad08::CountWidth::Bits32) {
      out.little(static_cast<std::uint32_t>(value));
    } else {
      out.little(value);
    }
  }

  const auto whole = out.written();
  const auto scan = whole.subspan(std::min(std::exchange(torn_, 0), whole.size()));
  fifo_.insert(fifo_.end(), scan.begin(), scan.end());
}

std::uint64_t CounterCard::value_of(std::size_t channel, HostTime at) {
  Counter& counter = counters_[channel];
  if (!counter.set_up) return 0;
  if (counter.setup.latch_on_index) return latched_value(channel, at);
  const auto count = static_cast<std::uint64_t>(signal_count(channel, at) - counter.zero);
  return count & (quad08::modulus_of(quad08::CountWidth::Bits48) - 1);
}

std::uint64_t CounterCard::latched_value(std::size_t channel, HostTime at) {
  Counter& counter = counters_[channel];
  const auto keep = [&](std::int64_t count) {
    counter.latched = static_cast<std::uint64_t>(count - counter.zero) &
                      (quad08::modulus_of(quad08::CountWidth::Bits48) - 1);
  };

  if (options_.channels[channel].probe_on_index) {
    const auto edge = latest_edge(at);
    if (edge && *edge > counter.set_up_at) keep(signal_count(channel, *edge));
    return counter.latched;
  }

  const auto* scale = std::get_if<ScaleSignal>(&options_.channels[channel].phases);
  if (scale == nullptr) return counter.latched;
  const double now = scale_reading(channel, *scale, at);
  const double before = std::exchange(counter.last_reading, now).value_or(now);

  // Of the marks passed since the previous scan, the latest is nearest to the current reading.
  const auto first =
      std::upper_bound(scale->marks.begin(), scale->marks.end(), std::min(before, now));
  const auto last =
      std::upper_bound(scale->marks.begin(), scale->marks.end(), std::max(before, now));
  if (first != last) keep(scale_count(*scale, now > before ? *std::prev(last) : *first));

  return counter.latched;
}

std::int64_t CounterCard::signal_count(std::size_t channel, HostTime at) {
  const PhaseSignal& signal = options_.channels[channel].phases;
  if (const auto* scale = std::get_if<ScaleSignal>(&signal))
    return scale_count(*scale, scale_reading(channel, *scale, at));
  if (const auto* clock = std::get_if<ClockSignal>(&signal))
    return clock_count(*clock, at) + clock_jump_;
  if (std::holds_alternative<TimerSignal>(signal)) return timer_count(at) + clock_jump_;
  if (std::holds_alternative<ProbeSignal>(signal)) return probe_count(at);
  return 0;
}

double CounterCard::scale_reading(std::size_t channel, const ScaleSignal& scale, HostTime at) {
  const double reading = scale.reading ? scale.reading(at) : 0.0;
  if (scale.noise == 0.0) return reading;
  const auto stream = static_cast<std::uint64_t>(NoiseStream::CounterCard) + channel;
  return reading + scale.noise * gaussian(options_.seed, stream, readings_++);
}

std::int64_t CounterCard::scale_count(const ScaleSignal& scale, double reading) const {
  return std::llround(reading / scale.step);
}

std::int64_t CounterCard::timer_count(HostTime at) const {
  constexpr std::size_t kWords = 4;  // high time, period; low word first
  if (!timer_began_ || at < *timer_began_ || timer_words_.size() < kWords) return 0;
  const std::uint32_t period = (std::uint32_t{timer_words_[3]} << 16 | timer_words_[2]) + 1;
  const double hz = quad08::kPacerClock_hz / period * (1.0 + 1e-6 * options_.pacer_deviation_ppm);
  return static_cast<std::int64_t>(std::floor(ns_to_seconds(at - *timer_began_) * hz));
}

void CounterCard::add_probe_edge(HostTime at) {
  edges_.push_back(at);
  if (edges_.size() <= kEdgesKept) return;
  edges_.pop_front();
  ++edges_forgotten_;
}

std::int64_t CounterCard::probe_count(HostTime at) const {
  const auto after = std::upper_bound(edges_.begin(), edges_.end(), at);
  return edges_forgotten_ + std::distance(edges_.begin(), after);
}

std::optional<HostTime> CounterCard::latest_edge(HostTime at) const {
  const auto after = std::upper_bound(edges_.begin(), edges_.end(), at);
  if (after == edges_.begin()) return std::nullopt;
  return *std::prev(after);
}

void CounterCard::restart() {
  counters_ = {};
  bank_ = mark_ = 0;
  scan_words_.clear();
  layout_ = {};
  dma_ = list_started_ = pacing_ = overrun_ = false;
  timer_words_.clear();
  timer_began_.reset();
  fifo_.clear();
}

void CounterCard::lose_scans(std::size_t count) {
  next_scan_ += count;
}

void CounterCard::jump_clock(std::int64_t counts) {
  clock_jump_ += counts;
}

void CounterCard::corrupt_register(std::uint16_t value) {
  corrupted_mark_ = value;
}

}  // namespace abbe::sim
