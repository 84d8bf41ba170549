#pragma once
/// The options of the card driver. A live device and its replay use the same ones. Pure.

#include "abbe/config/kinds/counter_card.hpp"
#include "abbe/drivers/counter_card/device.hpp"

namespace abbe::daemon {

/// Time-outs are multiplied by `speed`; see stretched().
[[nodiscard]] drivers::CounterCardOptions device_options(const CounterCardConfig& config,
                                                         double speed);

}  // namespace abbe::daemon
