#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "machine_order.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

constexpr Unit kMega{1e-6};
constexpr std::int64_t kLastChannel = static_cast<std::int64_t>(drivers::quad08::kChannels) - 1;

/// Keys that apply only to the other transport are refused instead of being ignored silently.
void read_transport(Section& card, CounterCardConfig& out) {
  card.get_word<CardTransport>("transport", out.transport,
                               {{"usb", CardTransport::Usb}, {"usbip", CardTransport::Usbip}},
                               Need::Required);
  get_host(card, "host", out.host);
  card.get_integer("port", out.port, 1, 65535);
  card.get("bus_id", out.bus_id);
  if (out.transport == CardTransport::Usbip) return;
  for (const auto key : {"host", "port", "bus_id"})
    if (card.has(key)) card.fault(key, "has no meaning with transport = \"usb\"");
}

void read_channel(Section& section, std::string_view key, std::optional<std::uint8_t>& out) {
  std::uint8_t channel = 0;
  if (section.get_integer(key, channel, 0, kLastChannel)) out = channel;
}

void read_debounce(Section& section, std::string_view key, drivers::quad08::Debounce& out) {
  std::uint8_t code = 0;
  if (!section.get_integer(key, code, 0, 15)) return;
  out = {.enabled = true, .time_code = code};
}

void read_clock(Section& card, drivers::CounterCardWiring& out) {
  card.get_integer("clock_channel", out.clock_channel, 0, kLastChannel);
  card.get_word<drivers::ClockSource>("clock_source", out.clock_source,
                                      {{"external", drivers::ClockSource::External},
                                       {"timer0", drivers::ClockSource::Timer0},
                                       {"timer1", drivers::ClockSource::Timer1}});
  card.get("clock_MHz", out.clock_hz, kMega, kPositive);
}

void read_probe(Section& card, drivers::CounterCardWiring& out) {
  read_channel(card, "latch_channel", out.latch_channel);
  read_channel(card, "edge_channel", out.edge_channel);
  read_debounce(card, "latch_debounce_code", out.latch_debounce);
  read_debounce(card, "edge_debounce_code", out.edge_debounce);
  card.get("latch_verified", out.latch_verified);
}

void read_scan(Section& card, CounterCardConfig& out) {
  int bits = 32;
  card.get("scan_rate_hz", out.wiring.scan_rate_hz, kPlain, kPositive);
  if (card.get_integer("width_bits", bits, 32, 48) && bits != 32 && bits != 48)
    card.fault("width_bits", "must be 32 or 48");
  out.wiring.width =
      bits == 48 ? drivers::quad08::CountWidth::Bits48 : drivers::quad08::CountWidth::Bits32;
  card.get_integer("sample_every", out.sample_every, 1, 1'000'000);
  card.get("max_constant_delay_us", out.max_constant_delay, kMicro, kNotNegative);
  card.get("axes_compensated", out.axes_compensated);
}

drivers::CounterAxis read_axis(Section& section, const MachineConfig& machine) {
  drivers::CounterAxis axis;
  const bool named = section.get("axis", axis.name, Need::Required);
  const AxisConfig* known = machine.find_axis(axis.name);
  if (named && known == nullptr && !machine.axes.empty())
    section.fault("axis", "no such axis in [axes]");
  const bool linear = known == nullptr || known->kind == AxisKind::Linear;
  section.get_integer("channel", axis.channel, 0, kLastChannel, Need::Required);
  section.get(linear ? "step_nm" : "step_nrad", axis.scale, kNano, kNotNegative, Need::Required);
  check_step(section, axis.scale, linear);
  section.get(linear ? "offset_mm" : "offset_rad", axis.offset, linear ? kMilli : kPlain, kAny);
  section.get("latch_on_index", axis.latch_on_index);
  read_debounce(section, "debounce_code", axis.debounce);
  bool invert = false;
  if (section.get("invert", invert) && invert) axis.scale = -axis.scale;
  section.close();

  return axis;
}

drivers::CounterAxis read_latched_axis(Section& section, const CounterCardConfig& live,
                                       ReferenceAxisConfig& marks) {
  drivers::CounterAxis axis{.latch_on_index = true};
  const bool named = section.get("axis", axis.name, Need::Required);
  const auto counted = std::ranges::find(live.wiring.axes, axis.name, &drivers::CounterAxis::name);
  if (named && counted == live.wiring.axes.end())
    section.fault("axis", "is not counted by [counter_card]");

  if (counted != live.wiring.axes.end()) {
    axis.scale = counted->scale;
    if (counted->offset != 0.0)
      section.fault(
          "axis", fmt::format("has an offset in [counter_card]; remove it, the marks of {} give it",
                              axis.name));
  }

  section.get_integer("channel", axis.channel, 0, kLastChannel, Need::Required);
  read_debounce(section, "debounce_code", axis.debounce);
  marks.axis = axis.name;

  return axis;
}

void read_marks(Section& section, bool linear, double step, ReferenceAxisConfig& out) {
  double length = 0.0;
  section.get(linear ? "signal_period_um" : "signal_period_urad", out.signal_period, kMicro,
              kPositive, Need::Required);
  section.get(linear ? "length_mm" : "length_rad", length, linear ? kMilli : kPlain, kPositive,
              Need::Required);
  section.get_integer("increment", out.code.increment, 2, 1'000'000);
  section.get(linear ? "zero_mark_mm" : "zero_mark_rad", out.zero_mark, linear ? kMilli : kPlain,
              kAny);
  section.get("reversed", out.reversed);
  out.code.rotary = !linear;
  out.code.length = std::llround(length / out.signal_period);
  const double counts = out.signal_period / std::abs(step);

  if (std::isfinite(counts) && std::abs(counts - std::round(counts)) > 1e-6 * counts)
    section.fault(
        "", fmt::format(
                "a signal period holds {:.6g} counts of [counter_card]: it must be a whole number",
                counts));
  if (const auto possible = drivers::check(out.code); !possible)
    section.fault("", possible.error().text);
}

void read_latched_axes(Section& section, const Config& config, ReferenceConfig& out) {
  for (auto& axis : section.children("axes")) {
    ReferenceAxisConfig marks;
    out.card.wiring.axes.push_back(read_latched_axis(axis, *config.counter_card, marks));
    const AxisConfig* known = config.machine.find_axis(marks.axis);
    const bool linear = known == nullptr || known->kind == AxisKind::Linear;
    read_marks(axis, linear, out.card.wiring.axes.back().scale, marks);
    axis.close();
    out.axes.push_back(std::move(marks));
  }
}

/// One card cannot both count continuously and latch at marks.
bool same_card(const CounterCardConfig& a, const CounterCardConfig& b) {
  if (a.transport != b.transport) return false;
  if (a.transport == CardTransport::Usb)
    return a.serial_number.empty() || a.serial_number == b.serial_number;
  return a.host == b.host && a.port == b.port && a.bus_id == b.bus_id;
}

}  // namespace

void read_reference(Section& root, Config& out, StreamNames& names) {
  Section section = root.child("reference");
  if (!section.present()) return;
  ReferenceConfig config;
  CounterCardConfig& card = config.card;
  card.name = "reference_card";
  card.wiring.scan_rate_hz = 2000.0;
  get_bounded(section, "name", card.name, bound_of<v1::AxisSample>("device"));
  section.get("serial_number", card.serial_number);
  read_transport(section, card);
  read_clock(section, card.wiring);
  section.get("scan_rate_hz", card.wiring.scan_rate_hz, kPlain, kPositive);
  section.get("max_constant_delay_us", card.max_constant_delay, kMicro, kNotNegative);
  section.get("latch_verified", card.wiring.latch_verified);
  section.get("u_alignment_us", config.u_alignment, kMicro, kPositive);
  section.get("tolerance_um", config.tolerance_m, kMicro, kPositive);

  if (!out.counter_card) {
    section.fault("", "needs [counter_card], which counts the same axes continuously");
    static_cast<void>(section.has("axes"));
  } else {
    if (same_card(*out.counter_card, card))
      section.fault("",
                    "is the card of [counter_card]: reference marks need a second card, selected "
                    "by its serial_number");
    read_latched_axes(section, out, config);
    if (const auto possible = drivers::check(card.wiring); !possible)
      section.fault("", possible.error().text);
  }

  section.close();
  names.take(card.name, section);
  out.reference = std::move(config);
}

void read_counter_card(Section& root, Config& out, StreamNames& names) {
  Section card = root.child("counter_card");
  if (!card.present()) return;
  CounterCardConfig config;
  get_bounded(card, "name", config.name, bound_of<v1::AxisSample>("device"));
  card.get("serial_number", config.serial_number);
  read_transport(card, config);
  read_clock(card, config.wiring);
  read_probe(card, config.wiring);
  read_scan(card, config);
  card.get_word<bool>("zero", config.zero_is_here, {{"unknown", false}, {"here", true}});
  for (auto& section : card.children("axes"))
    config.wiring.axes.push_back(read_axis(section, out.machine));
  put_in_order_of_the_machine(out.machine, &drivers::CounterAxis::name, card, "axes", "channel",
                              config.wiring.axes);

  // The driver checks the wiring; its error text names axis and channel.
  if (const auto possible = drivers::check(config.wiring); !possible)
    card.fault("", possible.error().text);
  for (const auto& axis : config.wiring.axes)
    if (const auto claimed = out.connected_axes();
        std::ranges::find(claimed, axis.name) != claimed.end())
      card.fault("axes",
                 fmt::format("axis {} is claimed by [encoder] and [counter_card]", axis.name));
  card.close();
  names.take(config.name, card);
  out.counter_card = std::move(config);
}

}  // namespace abbe::daemon
