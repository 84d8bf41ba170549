#pragma once
/// The options of the counter card's driver, the same for a live device and for its replay. Pure.

#include "abbe/config/kinds/counter_card.hpp"
#include "abbe/drivers/counter_card/device.hpp"

namespace abbe::daemon {

/// Options for `config`. `speed`: host seconds per second; time-outs are multiplied by it, see
/// stretched().
[[nodiscard]] drivers::CounterCardOptions device_options(const CounterCardConfig& config,
                                                         double speed);

}  // namespace abbe::daemon
