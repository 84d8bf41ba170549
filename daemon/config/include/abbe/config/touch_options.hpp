#pragma once
/// Converts [probe] and [counter_card] to the options of the touch detector in drivers. Pure.

#include "abbe/config/config.hpp"
#include "abbe/drivers/sampling/probe_options.hpp"

namespace abbe::daemon {

/// `machine` gives the kind of each axis, linear or rotary.
[[nodiscard]] drivers::TouchOptions touch_options(const ProbeConfig& probe,
                                                  const CounterCardConfig& card,
                                                  const MachineConfig& machine);

}  // namespace abbe::daemon
