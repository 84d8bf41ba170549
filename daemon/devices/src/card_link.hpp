#pragma once
/// Creates the USB link of a counter card: of the card that counts the axes, or of the card that
/// latches them on their reference marks.

#include <memory>

#include "abbe/config/config.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/drivers/usb/usb_link.hpp"

namespace abbe::daemon {

[[nodiscard]] std::unique_ptr<drivers::UsbLink> make_link(const CounterCardConfig& config,
                                                          const drivers::UsbIdentity& identity,
                                                          const drivers::TimeSource& time);

}  // namespace abbe::daemon
