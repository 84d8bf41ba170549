#pragma once
/// The loop of `abbe-sim bar --config`: simulates a measuring machine with one artefact after the
/// other on its table, until SIGINT or SIGTERM.

#include <string>
#include <vector>

#include "abbe/sim/simulation.hpp"

namespace abbe::sim {

/// An artefact on the table, until the operator replaces it by the next one.
struct OnTable {
  std::string name;  ///< name of the artefact: "N1"
  MeasuringMachine machine;
};

struct ClampingLoop {
  std::string ports_file;  ///< written when the machine listens; empty: none
  double speed = 1.0;      ///< simulated seconds per real second
};

/// Opens the simulation, whose measuring machine has the first of `things` on its table; every
/// SIGUSR1 puts the next one there, and prints its name. Returns the exit code.
[[nodiscard]] int run_clamping(SimulationSetup setup, const std::vector<OnTable>& things,
                               const ClampingLoop& options);

}  // namespace abbe::sim
