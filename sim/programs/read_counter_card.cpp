#include "read_counter_card.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace abbe::sim {
namespace {

std::optional<std::uint8_t> read_channel(Section& section, std::string_view key) {
  std::uint8_t channel = 0;
  if (!section.get_integer(key, channel, 0, static_cast<std::int64_t>(quad08::kChannels) - 1))
    return std::nullopt;
  return channel;
}

CardAxis read_card_axis(Section& section) {
  CardAxis axis;
  section.get("axis", axis.name);
  axis.channel = read_channel(section, "channel").value_or(0);
  section.get("step_nm", axis.step, kNano, kPositiveNumber);
  section.get("step_nrad", axis.step, kNano, kPositiveNumber);
  bool invert = false;
  section.get("invert", invert);
  if (invert) axis.step = -axis.step;
  return axis;
}

/// Reads the keys that every card has: its address, its clock and its probe channels.
CounterCardSetup read_card(Section& section) {
  CounterCardSetup card;
  get_port(section, "port", card.port);
  section.get_maybe_empty("serial_number", card.serial);
  std::string source = "external";
  section.get("clock_source", source);
  card.own_timer = source == "timer0";
  section.get("clock_MHz", card.clock_hz, kMega, kPositiveNumber);
  card.clock_channel = read_channel(section, "clock_channel").value_or(card.clock_channel);
  card.latch_channel = read_channel(section, "latch_channel");
  card.edge_channel = read_channel(section, "edge_channel");
  return card;
}

/// Reads an axis of [reference]: a scale of [counter_card] with its reference marks.
CardAxis read_marked_axis(Section& section, const CounterCardSetup& live) {
  CardAxis axis;
  std::string name;
  section.get("axis", name);
  const auto counted = std::ranges::find(live.axes, name, &CardAxis::name);

  if (counted == live.axes.end()) {
    section.fault("axis", "is not counted by [counter_card]");
    return axis;
  }

  axis = *counted;
  axis.channel = read_channel(section, "channel").value_or(0);
  double length = 0.0;
  section.get("signal_period_um", axis.signal_period, kMicro, kPositiveNumber);
  section.get("length_mm", length, kMilli, kPositiveNumber);
  section.get("zero_mark_mm", axis.marks_zero, kMilli, kAnyNumber);
  section.get_integer("increment", axis.nominal_increment, 2, 1'000'000);
  if (axis.signal_period > 0.0)
    axis.mark_pairs = static_cast<int>(length / (axis.signal_period * axis.nominal_increment));

  return axis;
}

}  // namespace

void read_counter_card(Section section, SimulationSetup& simulation) {
  if (!section.present()) return;
  CounterCardSetup card = read_card(section);
  for (Section& axis : section.children("axes")) card.axes.push_back(read_card_axis(axis));
  simulation.counter_cards.push_back(card);
}

void read_reference(Section section, SimulationSetup& simulation) {
  if (!section.present()) return;
  if (simulation.counter_cards.empty()) return section.fault("", "there is no [counter_card]");
  CounterCardSetup card = read_card(section);
  const CounterCardSetup& live = simulation.counter_cards.front();
  for (Section& axis : section.children("axes")) card.axes.push_back(read_marked_axis(axis, live));
  simulation.counter_cards.push_back(card);
}

void read_sim_counter_card(Section section, SimulationSetup& simulation) {
  if (!section.present()) return;
  if (simulation.counter_cards.empty())
    return section.fault("", "there is no [counter_card] in the machine file");
  CounterCardSetup& card = simulation.counter_cards.front();
  double noise_m = 0.0;
  double fifo_bytes = static_cast<double>(card.fifo_bytes);
  get_port(section, "port", card.port);
  section.get_maybe_empty("serial_number", card.serial);
  section.get("noise_nm", noise_m, kNano, kNotNegativeNumber);
  section.get("clock_deviation_ppm", card.clock_deviation_ppm, kPlain, {-1000.0, 1000.0});
  section.get("fifo_kB", fifo_bytes, Unit{1e-3}, {1.0, 1e6});
  card.fifo_bytes = static_cast<std::size_t>(std::lround(fifo_bytes));

  for (CardAxis& axis : card.axes) axis.noise = noise_m;
  section.close(Hint::AllKeys);
}

}  // namespace abbe::sim
