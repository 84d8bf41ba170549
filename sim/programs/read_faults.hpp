#pragma once
/// [[sim.fault]]: faults to inject, and their times.

#include <vector>

#include "abbe/sim/fault.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

void read_faults(Section& sim, std::vector<ScheduledFault>& faults);

}  // namespace abbe::sim
