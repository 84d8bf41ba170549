#include "usb_card.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "axis_steps.hpp"
#include "plausible.hpp"

namespace abbe::daemon {

namespace {

constexpr Unit kMega{1e-6};

}  // namespace

/// Reads how the card is connected. Keys that apply only to the other transport are refused,
/// because ignoring them silently would hide a mistake.
void read_card_address(ClassifiedSection& table, UsbCardConfig& out) {
  table.get_word<CardTransport>(operation("transport"), out.transport,
                                {{"usb", CardTransport::Usb}, {"usbip", CardTransport::Usbip}},
                                Need::Required);
  get_host(table, operation("host"), out.host);
  table.get_integer(operation("port"), out.port, 1, 65535);
  table.get(operation("bus_id"), out.bus_id);
  if (out.transport == CardTransport::Usbip) return;
  for (const auto key : {"host", "port", "bus_id"})
    if (table.has(key)) table.fault(key, "has no meaning with transport = \"usb\"");
}

void read_card_clock(ClassifiedSection& table, drivers::CounterCardWiring& out) {
  table.get_integer(reading("clock_channel"), out.clock_channel, 0, kLastChannel);
  table.get_word<drivers::ClockSource>(reading("clock_source"), out.clock_source,
                                       {{"external", drivers::ClockSource::External},
                                        {"timer0", drivers::ClockSource::Timer0},
                                        {"timer1", drivers::ClockSource::Timer1}});
  table.get(reading("clock_MHz"), out.clock_hz, kMega, kPositive);
}

void read_debounce(ClassifiedSection& table, Key key, drivers::quad08::Debounce& out) {
  std::uint8_t code = 0;
  if (!table.get_integer(key, code, 0, 15)) return;
  out = {.enabled = true, .time_code = code};
}

std::string card_text(const UsbCardConfig& card, const MachineConfig& machine) {
  std::vector<std::string> axes;
  for (const auto& axis : card.wiring.axes) {
    const AxisConfig* known = machine.find_axis(axis.name);
    const bool linear = known == nullptr || known->kind == AxisKind::Linear;
    axes.push_back(fmt::format("{} channel {} step {}", axis.name, axis.channel,
                               step_text(axis.scale, linear)));
  }

  const auto address = card.transport == CardTransport::Usb
                           ? std::string{"USB"}
                           : fmt::format("{}:{} (USB/IP) {}", card.host, card.port, card.bus_id);
  const auto serial =
      card.serial_number.empty() ? std::string{} : " serial number " + card.serial_number;
  return fmt::format("{}{}, {}", address, serial, fmt::join(axes, "; "));
}

}  // namespace abbe::daemon
