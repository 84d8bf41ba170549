#pragma once
/// Reads [sim.cmm]: a measuring machine over I++ DME and the true artefact on its table.

#include "abbe/sim/simulation.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// Reads the daemon's table [cmm]. If the table exists, a measuring machine with this port and tool
/// is simulated.
void read_cmm(Section section, SimulationSetup& simulation);
/// Reads [sim.cmm]. Sets `artefact_file` to the value of the key `artefact`; does not change it if
/// the key is missing.
void read_sim_cmm(Section section, SimulationSetup& simulation, std::string& artefact_file);
/// Reads a calibrator.toml whose blocks contain the positions of their faces. Io, or BadInput with
/// every fault at once.
[[nodiscard]] Result<void> read_artefact(const std::string& file, MeasuringMachine& machine);

}  // namespace abbe::sim
