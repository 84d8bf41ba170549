#include "card_link.hpp"

#include <utility>

#include "abbe/config/stretched.hpp"
#include "abbe/drivers/usb/libusb_link.hpp"
#include "abbe/drivers/usb/usbip_link.hpp"

namespace abbe::daemon {

std::unique_ptr<drivers::UsbLink> make_link(const UsbCardConfig& config,
                                            const drivers::UsbIdentity& identity,
                                            const drivers::TimeSource& time) {
  if (config.transport == CardTransport::Usb)
    return std::make_unique<drivers::LibusbLink>(identity, time);
  return std::make_unique<drivers::UsbipLink>(
      drivers::UsbipOptions{
          .host = config.host, .port = config.port, .bus_id = config.bus_id, .identity = identity},
      time);
}

drivers::CounterCardOptions card_options(const UsbCardConfig& config, double speed) {
  drivers::CounterCardOptions options;
  options.name = config.name;
  options.serial = config.serial_number;
  options.receiver.wiring = config.wiring;
  options.receiver.clock.max_constant_delay = config.max_constant_delay;
  options.transfer_time = stretched(options.transfer_time, speed);
  auto& session = options.session;

  for (auto* time_out : {&session.open_timeout, &session.control_timeout, &session.status_period,
                         &session.reopen_after, &session.retry_after}) {
    *time_out = stretched(*time_out, speed);
  }
  session.silence = stretched_silence(session.silence, speed);

  return options;
}

std::vector<std::string> with_assumption(std::vector<std::string> warnings,
                                         const drivers::CounterCardDevice& card) {
  if (auto assumed = card.assumption(); !assumed.empty()) warnings.push_back(std::move(assumed));
  return warnings;
}

}  // namespace abbe::daemon
