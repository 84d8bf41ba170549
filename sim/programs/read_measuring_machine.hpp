#pragma once
/// [sim.cmm]: a measuring machine over I++ DME and the artefact on its table, as it truly is.

#include "abbe/sim/simulation.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// Reads the daemon's table [cmm]: if it exists, there is a measuring machine, with this port and
/// tool.
void read_cmm(Section section, SimulationSetup& simulation);
/// Reads [sim.cmm]. `artefact_file` becomes the value of the key `artefact`; unchanged without the
/// key.
void read_sim_cmm(Section section, SimulationSetup& simulation, std::string& artefact_file);
/// Reads a calibrator.toml whose blocks contain the positions of their faces. Io, or BadInput with
/// every fault at once.
[[nodiscard]] Result<void> read_artefact(const std::string& file, MeasuringMachine& machine);

}  // namespace abbe::sim
