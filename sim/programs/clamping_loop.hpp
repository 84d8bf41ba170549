#pragma once
/// The loop of `abbe-sim bar --config`: a measuring machine on its port, and one thing after the
/// other on its table, until SIGINT or SIGTERM.

#include <string>
#include <vector>

#include "abbe/sim/simulation.hpp"

namespace abbe::sim {

/// What lies on the table until the operator puts the next thing there.
struct OnTable {
  std::string name;  ///< "N1"
  MeasuringMachine machine;
};

struct ClampingLoop {
  std::string ports_file;  ///< written when the machine listens; empty: none
  double speed = 1.0;      ///< simulated seconds per second
};

/// Opens the simulation, whose measuring machine has the first of `things` on its table; every
/// SIGUSR1 puts the next one there, and prints its name. Returns the exit code.
[[nodiscard]] int run_clamping(SimulationSetup setup, const std::vector<OnTable>& things,
                               const ClampingLoop& options);

}  // namespace abbe::sim
