#include "card_link.hpp"

#include <utility>

#include "abbe/drivers/usb/libusb_link.hpp"
#include "abbe/drivers/usb/usbip_link.hpp"

namespace abbe::daemon {

std::unique_ptr<drivers::UsbLink> make_link(const CounterCardConfig& config,
                                            const drivers::UsbIdentity& identity,
                                            const drivers::TimeSource& time) {
  if (config.transport == CardTransport::Usb)
    return std::make_unique<drivers::LibusbLink>(identity, time);
  return std::make_unique<drivers::UsbipLink>(
      drivers::UsbipOptions{
          .host = config.host, .port = config.port, .bus_id = config.bus_id, .identity = identity},
      time);
}

std::vector<std::string> with_assumption(std::vector<std::string> warnings,
                                         const drivers::CounterCardDevice& card) {
  if (auto assumed = card.assumption(); !assumed.empty()) warnings.push_back(std::move(assumed));
  return warnings;
}

}  // namespace abbe::daemon
