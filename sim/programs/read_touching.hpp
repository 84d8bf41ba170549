#pragma once
/// What abbe-sim evemu plays: how it is touched, and the array that is.

#include "setup_file.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

/// [sim.evemu].
void read_sim_evemu(TomlSection section, LoadedSetup& setup);
/// [sim.ball_array]: the array that is touched, against what its calibrator.toml says.
void read_ball_array(TomlSection section, ArrayState& array);

}  // namespace abbe::sim
