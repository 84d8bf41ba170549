#pragma once
/// [[sim.fault]]: faults to inject, and their times.

#include <vector>

#include "abbe/sim/fault.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

void read_faults(TomlSection& sim, std::vector<ScheduledFault>& faults);

}  // namespace abbe::sim
