#include <fmt/format.h>

#include "config/machine_order.hpp"
#include "config/message_bounds.hpp"
#include "config/readers.hpp"

namespace abbe::daemon {

namespace {

constexpr Unit kMega{1e-6};
constexpr std::int64_t kLastChannel = static_cast<std::int64_t>(drivers::quad08::kChannels) - 1;

/// Keys that only make sense on the other transport are refused: they would be silently ignored.
void read_transport(Section& card, CounterCardConfig& out) {
  card.get_word<CardTransport>("transport", out.transport,
                               {{"usb", CardTransport::Usb}, {"usbip", CardTransport::Usbip}},
                               Need::Required);
  card.get("host", out.host);
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
  out.wiring.width = bits == 48 ? drivers::quad08::CountWidth::Bits48 : drivers::quad08::CountWidth::Bits32;
  card.get_integer("sample_every", out.sample_every, 1, 1'000'000);
  card.get("max_constant_delay_us", out.max_constant_delay, kMicro, kNotNegative);
  card.get("axes_compensated", out.axes_compensated);
}

drivers::CounterAxis read_axis(Section& section, const MachineConfig& machine) {
  drivers::CounterAxis axis;
  const bool named = section.get("axis", axis.name, Need::Required);
  const AxisConfig* known = machine.find_axis(axis.name);
  if (named && known == nullptr && !machine.axes.empty()) section.fault("axis", "no such axis in [axes]");
  const bool linear = known == nullptr || known->kind == AxisKind::Linear;
  section.get_integer("channel", axis.channel, 0, kLastChannel, Need::Required);
  section.get(linear ? "step_nm" : "step_nrad", axis.scale, kNano, kNotNegative, Need::Required);
  section.get(linear ? "offset_mm" : "offset_rad", axis.offset, linear ? kMilli : kPlain, kAny);
  section.get("latch_on_index", axis.latch_on_index);
  read_debounce(section, "debounce_code", axis.debounce);
  bool invert = false;
  if (section.get("invert", invert) && invert) axis.scale = -axis.scale;
  section.close();
  return axis;
}

}  // namespace

void read_counter_card(Section& root, Config& out) {
  Section card = root.child("counter_card");
  if (!card.present()) return;
  CounterCardConfig config;
  get_bounded(card, "name", config.name, bound_of<v1::AxisSample>("device"));
  card.get("serial_number", config.serial_number);
  read_transport(card, config);
  read_clock(card, config.wiring);
  read_probe(card, config.wiring);
  read_scan(card, config);
  for (auto& section : card.children("axes")) config.wiring.axes.push_back(read_axis(section, out.machine));
  put_in_order_of_the_machine(out.machine, &drivers::CounterAxis::name, card, "axes", "channel",
                              config.wiring.axes);
  // The driver knows what a wiring must be; its sentence names axis and channel.
  if (const auto possible = drivers::check(config.wiring); !possible) card.fault("", possible.error().text);
  for (const auto& axis : config.wiring.axes)
    if (const auto claimed = out.connected_axes(); std::ranges::find(claimed, axis.name) != claimed.end())
      card.fault("axes", fmt::format("axis {} is claimed by [encoder] and [counter_card]", axis.name));
  card.close();
  out.counter_card = std::move(config);
}

}  // namespace abbe::daemon
