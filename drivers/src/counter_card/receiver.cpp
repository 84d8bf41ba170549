// Construction from the wiring; the real-time part is in rt/counter_card_receiver.cpp.
#include "abbe/drivers/counter_card/receiver.hpp"

namespace abbe::drivers {
namespace {

// Relative rate error between the clock and the pacer (the timer of the scans): two quartzes, each
// with the limit of the clock model.
constexpr double kQuartzDeviation = 2.0 * ClockModelOptions{}.max_skew;
constexpr double kReading_counts = 2.0;  // each reading is rounded to whole periods

}  // namespace

CounterCardReceiver::CounterCardReceiver(const CounterCardReceiverOptions& options)
    : width_(options.wiring.width),
      clock_hz_(options.wiring.clock_hz),
      clock_(options.clock),
      latch_(options.wiring.width, options.wiring.clock_source != ClockSource::External),
      decoder_(layout_of(options.wiring)) {
  const auto& wiring = options.wiring;
  const auto& layout = decoder_.layout();
  metronome_.place = layout.place_of(wiring.clock_channel).value_or(0);
  metronome_.step = clock_counts_per_scan(wiring);
  metronome_.tolerance = kReading_counts + kQuartzDeviation * metronome_.step;
  if (wiring.latch_channel) latch_place_ = layout.place_of(*wiring.latch_channel);
  if (wiring.edge_channel) edge_place_ = layout.place_of(*wiring.edge_channel);
  current_.axes.axis_count = static_cast<std::uint8_t>(wiring.axes.size());
  for (std::size_t i = 0; i < wiring.axes.size(); ++i) {
    const auto& axis = wiring.axes[i];
    axes_[i] = {layout.place_of(axis.channel).value_or(0), axis.scale, axis.offset};
    if (!axis.latch_on_index) continue;
    const auto bit = static_cast<std::uint8_t>(1u << i);
    current_.index_latched_mask = static_cast<std::uint8_t>(current_.index_latched_mask | bit);
    current_.axes.missing_mask = current_.index_latched_mask;
  }
  if (options.resume_from) seed(*options.resume_from);
}

/// Continues from the counts of an earlier run. A set-up zeroed the counters, so each last raw
/// reading is the stored count modulo the counter's range.
void CounterCardReceiver::seed(const CounterCardProgress& from) {
  const std::uint64_t round = quad08::modulus_of(width_) - 1;
  quad08::RawScan& last = last_.emplace();
  last[metronome_.place] = static_cast<std::uint64_t>(from.clock_count) & round;
  current_.clock_count = from.clock_count;
  for (std::size_t i = 0; i < current_.axes.axis_count; ++i) {
    last[axes_[i].place] = static_cast<std::uint64_t>(from.count[i]) & round;
    current_.axes.count[i] = from.count[i];
  }
  resumption_ = Resumption{.since = from.head.time, .begun = {}};
}

}  // namespace abbe::drivers
