#pragma once
/// Simulated counter cards: their wiring from the daemon's tables, and the properties of the
/// simulation, which the daemon's tables do not contain.

#include "abbe/sim/simulation.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// Reads the daemon's [counter_card]: the wiring of the card.
void read_counter_card(Section section, SimulationSetup& simulation);
/// Reads the daemon's [reference]: adds a second card that counts the same scales and has their
/// reference marks.
void read_reference(Section section, SimulationSetup& simulation);
/// Reads [sim.counter_card]: properties of the simulation that [counter_card] does not contain.
void read_sim_counter_card(Section section, SimulationSetup& simulation);

}  // namespace abbe::sim
