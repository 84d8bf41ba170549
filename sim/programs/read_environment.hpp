#pragma once
/// [[sim.environment]]: simulated Modbus devices, from the simulator's own table.

#include <vector>

#include "abbe/sim/modbus_server.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

void read_environment(TomlSection& sim, std::vector<ModbusServerOptions>& devices);

}  // namespace abbe::sim
