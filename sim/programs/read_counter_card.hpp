#pragma once
/// Simulated counter cards: their wiring from the daemon's tables, and the properties of the
/// simulation, which the daemon's tables do not contain.

#include "abbe/sim/simulation.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

/// The daemon's [counter_card]: the wiring of the card.
void read_counter_card(TomlSection section, SimulationSetup& simulation);
/// The daemon's [reference]: a second card on the same scales, with their marks.
void read_reference(TomlSection section, SimulationSetup& simulation);
/// [sim.counter_card]: properties of the simulation that [counter_card] does not contain.
void read_sim_counter_card(TomlSection section, SimulationSetup& simulation);

}  // namespace abbe::sim
