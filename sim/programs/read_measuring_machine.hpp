#pragma once
/// [sim.cmm]: a measuring machine over I++ DME and the artefact on its table, as it truly is.

#include "abbe/sim/simulation.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

/// The daemon's [cmm]: there is one, and on which port.
void read_cmm(TomlSection section, SimulationSetup& simulation);
/// `artefact_file`: what the key `artefact` says, empty if nothing.
void read_sim_cmm(TomlSection section, SimulationSetup& simulation, std::string& artefact_file);
/// A calibrator.toml whose blocks say where their faces are. Io, or BadInput with every fault at
/// once.
[[nodiscard]] Result<void> read_artefact(const std::string& file, MeasuringMachine& machine);

}  // namespace abbe::sim
