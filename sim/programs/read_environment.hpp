#pragma once
/// [[sim.environment]]: simulated Modbus devices, from the simulator's own table.

#include <vector>

#include "abbe/sim/modbus_server.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

void read_environment(Section& sim, std::vector<ModbusServerOptions>& devices);

}  // namespace abbe::sim
