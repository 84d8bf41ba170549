// Taking over the wiring; the rest runs in real time and is rt/counter_card_receiver.cpp.
#include "abbe/drivers/counter_card/receiver.hpp"

namespace abbe::drivers {
namespace {

constexpr double kQuartzDeviation = 500e-6;  // clock against pacer: two quartzes
constexpr double kReading_counts = 2.0;      // each reading is whole periods

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
}

}  // namespace abbe::drivers
