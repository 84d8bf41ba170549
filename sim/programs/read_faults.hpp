#pragma once
/// [[sim.fault]]: what goes wrong, and when.

#include <vector>

#include "abbe/sim/fault.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

void read_faults(TomlSection& sim, std::vector<ScheduledFault>& faults);

}  // namespace abbe::sim
