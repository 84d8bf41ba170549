#include "read_counter_card.hpp"

#include <algorithm>
#include <optional>

namespace abbe::sim {
namespace {

std::optional<std::uint8_t> read_channel(TomlSection& section, std::string_view key) {
  std::int64_t channel = 0;
  if (!section.integer(key, channel, 0, static_cast<std::int64_t>(quad08::kChannels) - 1))
    return std::nullopt;
  return static_cast<std::uint8_t>(channel);
}

CardAxis read_card_axis(TomlSection& section) {
  CardAxis axis;
  section.text("axis", axis.name);
  axis.channel = read_channel(section, "channel").value_or(0);
  section.number("step_nm", axis.step, 1e-9, kPositiveNumber);
  section.number("step_nrad", axis.step, 1e-9, kPositiveNumber);
  bool invert = false;
  section.flag("invert", invert);
  if (invert) axis.step = -axis.step;
  return axis;
}

/// Reads the keys that every card has: its address, its clock and its probe channels.
CounterCardSetup read_card(TomlSection& section) {
  CounterCardSetup card;
  section.port("port", card.port);
  section.text("serial_number", card.serial);
  std::string source = "external";
  section.text("clock_source", source);
  card.own_timer = source == "timer0";
  section.number("clock_MHz", card.clock_hz, 1e6, kPositiveNumber);
  card.clock_channel = read_channel(section, "clock_channel").value_or(card.clock_channel);
  card.latch_channel = read_channel(section, "latch_channel");
  card.edge_channel = read_channel(section, "edge_channel");
  return card;
}

/// Reads an axis of [reference]: a scale of [counter_card] with its reference marks.
CardAxis read_marked_axis(TomlSection& section, const CounterCardSetup& live) {
  CardAxis axis;
  std::string name;
  section.text("axis", name);
  const auto counted = std::ranges::find(live.axes, name, &CardAxis::name);

  if (counted == live.axes.end()) {
    section.fault("axis", "is not counted by [counter_card]");
    return axis;
  }

  axis = *counted;
  axis.channel = read_channel(section, "channel").value_or(0);
  std::int64_t increment = axis.nominal_increment;
  double length = 0.0;
  section.number("signal_period_um", axis.signal_period, kMicro, kPositiveNumber);
  section.number("length_mm", length, kMilli, kPositiveNumber);
  section.number("zero_mark_mm", axis.marks_zero, kMilli);
  section.integer("increment", increment, 2, 1'000'000);
  axis.nominal_increment = static_cast<int>(increment);
  if (axis.signal_period > 0.0)
    axis.mark_pairs =
        static_cast<int>(length / (axis.signal_period * static_cast<double>(increment)));

  return axis;
}

}  // namespace

void read_counter_card(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  CounterCardSetup card = read_card(section);
  for (TomlSection& axis : section.children("axes")) card.axes.push_back(read_card_axis(axis));
  simulation.counter_cards.push_back(card);
}

void read_reference(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  if (simulation.counter_cards.empty()) return section.fault("", "there is no [counter_card]");
  CounterCardSetup card = read_card(section);
  const CounterCardSetup& live = simulation.counter_cards.front();
  for (TomlSection& axis : section.children("axes"))
    card.axes.push_back(read_marked_axis(axis, live));
  simulation.counter_cards.push_back(card);
}

void read_sim_counter_card(TomlSection section, SimulationSetup& simulation) {
  if (!section.present()) return;
  if (simulation.counter_cards.empty())
    return section.fault("", "there is no [counter_card] in the machine file");
  CounterCardSetup& card = simulation.counter_cards.front();
  double noise_m = 0.0;
  double fifo_bytes = static_cast<double>(card.fifo_bytes);
  section.port("port", card.port);
  section.text("serial_number", card.serial);
  section.number("noise_nm", noise_m, 1e-9, kNotNegativeNumber);
  section.number("clock_deviation_ppm", card.clock_deviation_ppm, 1.0, {-1000.0, 1000.0});
  section.number("fifo_kB", fifo_bytes, 1e3, {1.0, 1e6});
  card.fifo_bytes = static_cast<std::size_t>(fifo_bytes);

  for (CardAxis& axis : card.axes) axis.noise = noise_m;
  section.refuse_unknown_keys();
}

}  // namespace abbe::sim
