#pragma once
/// Driver options and USB link of a counter card: of the card that counts the axes, or of the card
/// that latches them on their reference marks.

#include <memory>
#include <string>
#include <vector>

#include "abbe/config/usb_card.hpp"
#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/drivers/usb/usb_link.hpp"

namespace abbe::daemon {

/// Options for `config`. `speed`: host seconds per second; time-outs are multiplied by it, see
/// stretched().
[[nodiscard]] drivers::CounterCardOptions card_options(const UsbCardConfig& config, double speed);

[[nodiscard]] std::unique_ptr<drivers::UsbLink> make_link(const UsbCardConfig& config,
                                                          const drivers::UsbIdentity& identity,
                                                          const drivers::TimeSource& time);

/// Appends to `warnings` the unverified assumption of the driver about this card, if there is one.
[[nodiscard]] std::vector<std::string> with_assumption(std::vector<std::string> warnings,
                                                       const drivers::CounterCardDevice& card);

}  // namespace abbe::daemon
