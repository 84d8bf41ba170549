#pragma once
/// Simulated counter cards: wired as the daemon's tables say, and what the daemon cannot know of
/// them.

#include "abbe/sim/simulation.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

/// The daemon's [counter_card]: its wiring is the card's.
void read_counter_card(TomlSection section, SimulationSetup& simulation);
/// The daemon's [reference]: a second card on the same scales, with their marks.
void read_reference(TomlSection section, SimulationSetup& simulation);
/// [sim.counter_card]: what the daemon cannot know of it.
void read_sim_counter_card(TomlSection section, SimulationSetup& simulation);

}  // namespace abbe::sim
