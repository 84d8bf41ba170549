#pragma once
/// [probe]: the touch probe that is wired to the latch or edge channel of the card that counts the
/// axes. Delay and jitter of the probe are determined by `abbe calibrate probe`. The channels are
/// part of the table of the card. Pure data.

#include <chrono>
#include <string>

#include "abbe/drivers/counter_card/wiring.hpp"
#include "abbe/drivers/sampling/probe_options.hpp"

namespace abbe::daemon {

struct ConfigKind;
struct MachineConfig;

struct ProbeConfig {
  static const ConfigKind kKind;
  std::string name = "probe";
  drivers::ProbeDelay delay;
  drivers::ProbeApproach approach;
  drivers::ProbeSwitching switching;
  std::chrono::nanoseconds window_before{std::chrono::milliseconds{10}};
  std::chrono::nanoseconds window_after{std::chrono::milliseconds{10}};
};

/// Options of the touch detector in drivers. `wiring` is that of the counter card. `machine`
/// defines the kind of each axis, linear or rotary.
[[nodiscard]] drivers::TouchOptions touch_options(const ProbeConfig& probe,
                                                  const drivers::CounterCardWiring& wiring,
                                                  const MachineConfig& machine);

}  // namespace abbe::daemon
