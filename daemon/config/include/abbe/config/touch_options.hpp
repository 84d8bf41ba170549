#pragma once
/// [probe] and [counter_card] as the options of the drivers' touch detector. Pure.

#include "abbe/config/config.hpp"
#include "abbe/drivers/sampling/probe_options.hpp"

namespace abbe::daemon {

/// The probe on the card's channels; `machine` says which axes are linear.
[[nodiscard]] drivers::TouchOptions touch_options(const ProbeConfig& probe,
                                                  const CounterCardConfig& card,
                                                  const MachineConfig& machine);

}  // namespace abbe::daemon
