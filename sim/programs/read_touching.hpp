#pragma once
/// The tables of abbe-sim evemu: how the ball array is touched, and the state of the array.

#include "setup_file.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

/// [sim.evemu].
void read_sim_evemu(TomlSection section, LoadedSetup& setup);
/// Reads [sim.ball_array]: how the true array differs from its calibrator.toml.
void read_ball_array(TomlSection section, ArrayState& array);

}  // namespace abbe::sim
