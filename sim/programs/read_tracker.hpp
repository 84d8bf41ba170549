#pragma once
/// [sim.tracker], with the drift of the tracker and the reference nests that it visits.

#include "setup_draft.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

void read_sim_tracker(TomlSection section, SetupDraft& draft);
/// The nests of [[tracker.nest]] in the machine file: they are where they are configured, unless
/// [[sim.tracker.nest]] gives other positions.
void read_nests(TomlSection& tracker, SimulationSetup& simulation);

}  // namespace abbe::sim
