#include "abbe/sim/counter_card_setup.hpp"

#include <algorithm>

namespace abbe::sim {
namespace {

std::function<double(HostTime)> reading_of(const CardAxis& axis, const VirtualMachine& machine) {
  MeasuredAxis measured = axis.swing;
  if (const auto linear = axis_named(axis.name)) measured = *linear;
  return [&machine, measured](HostTime at) { return reading(measured, machine, at); };
}

PhaseSignal clock_of(const CounterCardSetup& setup) {
  if (setup.own_timer) return TimerSignal{};
  return ClockSignal{.hz = setup.clock_hz, .deviation_ppm = setup.clock_deviation_ppm};
}

}  // namespace

std::vector<double> distance_coded_marks(double zero, double signal_period, int nominal_increment,
                                         int pairs) {
  std::vector<double> marks;
  for (int k = 0; k < pairs; ++k) {
    const int fixed = k * nominal_increment;
    const int coded = fixed + nominal_increment / 2 + k + 1;
    marks.push_back(zero + signal_period * fixed);
    marks.push_back(zero + signal_period * coded);
  }
  std::ranges::sort(marks);
  return marks;
}

CounterCardOptions wire(const CounterCardSetup& setup, const VirtualMachine& machine) {
  CounterCardOptions card;
  card.serial = setup.serial;
  card.fifo_bytes = setup.fifo_bytes;
  card.seed = setup.seed;

  for (const CardAxis& axis : setup.axes) {
    ScaleSignal scale{
        .reading = reading_of(axis, machine), .step = axis.step, .noise = axis.noise, .marks = {}};
    if (axis.signal_period > 0.0) {
      scale.marks = distance_coded_marks(axis.marks_zero, axis.signal_period,
                                         axis.nominal_increment, axis.mark_pairs);
    }
    card.channels.at(axis.channel).phases = std::move(scale);
  }

  card.channels.at(setup.clock_channel).phases = clock_of(setup);
  if (setup.latch_channel) card.channels.at(*setup.latch_channel) = {clock_of(setup), true};
  if (setup.edge_channel) card.channels.at(*setup.edge_channel).phases = ProbeSignal{};

  return card;
}

}  // namespace abbe::sim
