#pragma once
/// [axis_lines] of the machine file, and [sim.axis_lines].

#include "setup_draft.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// The columns of a line. `root` has the axes.
void read_axis_lines(Section root, SimulationSetup& simulation);
/// The control that prints them.
void read_sim_axis_lines(Section section, SimulationSetup& simulation);

}  // namespace abbe::sim
