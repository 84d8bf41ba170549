#include "abbe/config/kinds/counter_card.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "axis_steps.hpp"
#include "classified_section.hpp"
#include "config_kind.hpp"
#include "machine_order.hpp"
#include "message_bounds.hpp"
#include "usb_card.hpp"

namespace abbe::daemon {

namespace {

void read_channel(ClassifiedSection& section, Key key, std::optional<std::uint8_t>& out) {
  std::uint8_t channel = 0;
  if (section.get_integer(key, channel, 0, kLastChannel)) out = channel;
}

void read_touch_channels(ClassifiedSection& card, drivers::CounterCardWiring& out) {
  read_channel(card, if_given(measurement("latch_channel")), out.latch_channel);
  read_channel(card, if_given(measurement("edge_channel")), out.edge_channel);
  read_debounce(card, operation("latch_debounce_code"), out.latch_debounce);
  read_debounce(card, operation("edge_debounce_code"), out.edge_debounce);
  card.get(operation("latch_verified"), out.latch_verified);
}

void read_scan(ClassifiedSection& card, CounterCardConfig& out) {
  int bits = 32;
  card.get(operation("scan_rate_hz"), out.card.wiring.scan_rate_hz, kPlain, kPositive);
  if (card.get_integer(reading("width_bits"), bits, 32, 48) && bits != 32 && bits != 48)
    card.fault("width_bits", "must be 32 or 48");
  out.card.wiring.width =
      bits == 48 ? drivers::quad08::CountWidth::Bits48 : drivers::quad08::CountWidth::Bits32;
  card.get_integer(operation("sample_every"), out.sample_every, 1, 1'000'000);
  card.get(reading("max_constant_delay_us"), out.card.max_constant_delay, kMicro, kNotNegative);
  card.get(reading("axes_compensated"), out.axes_compensated);
}

drivers::CounterAxis read_counted_axis(ClassifiedSection& section, const MachineConfig& machine) {
  drivers::CounterAxis axis;
  const bool named = section.get(stated("axis"), axis.name, Need::Required);
  const AxisConfig* known = machine.find_axis(axis.name);
  if (named && known == nullptr && !machine.axes.empty())
    section.fault("axis", "no such axis in [axes]");
  const bool linear = known == nullptr || known->kind == AxisKind::Linear;
  section.get_integer(reading("channel"), axis.channel, 0, kLastChannel, Need::Required);
  section.get(reading(linear ? "step_nm" : "step_nrad"), axis.scale, kNano, kNotNegative,
              Need::Required);
  check_step(section, axis.scale, linear);
  section.get(reading(linear ? "offset_mm" : "offset_rad"), axis.offset, linear ? kMilli : kPlain,
              kAny);
  section.get(reading("latch_on_index"), axis.latch_on_index);
  read_debounce(section, operation("debounce_code"), axis.debounce);
  bool invert = false;
  if (section.get(reading("invert"), invert) && invert) axis.scale = -axis.scale;
  section.close();

  return axis;
}

void read_counter_card(ClassifiedSection& root, Config& out, StreamNames& names) {
  ClassifiedSection table = root.child("counter_card");
  if (!table.present()) return;
  CounterCardConfig config;
  UsbCardConfig& card = config.card;
  get_bounded(table, operation("name"), card.name, bound_of<v1::AxisSample>("device"));
  table.get(operation("serial_number"), card.serial_number);
  read_card_address(table, card);
  read_card_clock(table, card.wiring);
  read_touch_channels(table, card.wiring);
  read_scan(table, config);
  table.get_word<bool>(reading("zero"), config.zero_is_here, {{"unknown", false}, {"here", true}});
  for (auto& section : table.children("axes", "axis"))
    card.wiring.axes.push_back(read_counted_axis(section, out.machine));
  put_in_order_of_the_machine(out.machine, &drivers::CounterAxis::name, table, "axes", "channel",
                              card.wiring.axes);

  // The driver checks the wiring; the text of its error names axis and channel.
  if (const auto possible = drivers::check(card.wiring); !possible)
    table.fault("", possible.error().text);
  for (const auto& axis : card.wiring.axes)
    refuse_claimed_axis(table, "axes", axis.name, CounterCardConfig::kKind.key, out);
  table.close();
  names.take(card.name, table);
  out.of<CounterCardConfig>() = std::move(config);
}

void doubt_counter_card(Section& root, const Config& config) {
  doubt_steps(root, "counter_card", "axes", config.machine);
}

std::vector<std::string> counter_card_summary(const Config& config) {
  const auto& counter = config.of<CounterCardConfig>();
  if (!counter) return {};
  return {card_text(counter->card, config.machine)};
}

std::string former_counter_card_text(const Config& config) {
  const auto& counter = config.of<CounterCardConfig>();
  if (!counter) return {};
  std::string text = counter->axes_compensated ? "|compensated" : "|raw";
  for (const auto& axis : counter->card.wiring.axes)
    text += fmt::format("|{} {} {:.17g} {:.17g}", axis.name, axis.channel, axis.scale, axis.offset);
  return text;
}

std::optional<AxisReadings> counter_card_axes(const Config& config) {
  const auto& counter = config.of<CounterCardConfig>();
  if (!counter) return std::nullopt;
  AxisReadings readings{
      .key = CounterCardConfig::kKind.key, .axes = {}, .compensated = counter->axes_compensated};
  for (const auto& axis : counter->card.wiring.axes) readings.axes.push_back(axis.name);
  return readings;
}

std::optional<std::chrono::nanoseconds> time_of_counter_card_samples(const Config& config,
                                                                     double periods) {
  const auto& counter = config.of<CounterCardConfig>();
  if (!counter) return std::nullopt;
  const double sample_rate_hz = drivers::scan_rate_hz(counter->card.wiring) / counter->sample_every;
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>{periods / sample_rate_hz});
}

std::optional<CountedAxes> axes_counted_by_card(const Config& config) {
  const auto& counter = config.of<CounterCardConfig>();
  if (!counter) return std::nullopt;
  return CountedAxes{.key = CounterCardConfig::kKind.key,
                     .card = counter->card,
                     .zero_is_here = counter->zero_is_here};
}

}  // namespace

const ConfigKind CounterCardConfig::kKind{.key = "counter_card",
                                          .read = &read_counter_card,
                                          .doubt = &doubt_counter_card,
                                          .summary = &counter_card_summary,
                                          .former_text = &former_counter_card_text,
                                          .axes = &counter_card_axes,
                                          .time_of_axis_samples = &time_of_counter_card_samples,
                                          .counted = &axes_counted_by_card};

}  // namespace abbe::daemon
