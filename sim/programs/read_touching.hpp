#pragma once
/// Reads the tables of abbe-sim evemu: how the ball array is touched, and the state of the array.

#include "setup_file.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// Reads [sim.evemu].
void read_sim_evemu(Section section, LoadedSetup& setup);
/// Reads [sim.ball_array]: how the true array differs from its calibrator.toml.
void read_ball_array(Section section, ArrayState& array);

}  // namespace abbe::sim
