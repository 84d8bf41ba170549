#pragma once
/// Reads the simulated tracker: [sim.tracker] with its drift, and the reference nests that it
/// visits.

#include "setup_draft.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

void read_sim_tracker(Section section, SetupDraft& draft);
/// Reads the nests of [[tracker.nest]] in the machine file. They are at their configured positions,
/// unless [[sim.tracker.nest]] gives other positions.
void read_nests(Section& tracker, SimulationSetup& simulation);

/// Reads `protocol = "lines"` with its keys, in [tracker] of the machine file or in [sim.tracker].
void read_lines(Section& tracker, SimulationSetup& simulation);

}  // namespace abbe::sim
