#pragma once
/// The loop of the programs in which a machine touches an artefact: scales and probe on a simulated
/// counter card, until SIGINT or SIGTERM.

#include <string>

#include "abbe/sim/simulation.hpp"

namespace abbe::sim {

struct TouchingLoop {
  std::string ports_file;        ///< written when the card listens; empty: none
  bool start_on_signal = false;  ///< the motion starts on SIGUSR1
  double speed = 1.0;            ///< simulated seconds per real second
};

/// Opens the simulation, prints `what` ("144 touches"), and runs it. Returns the exit code.
[[nodiscard]] int run_touching(const SimulationSetup& setup, const TouchingLoop& options,
                               const std::string& what);

}  // namespace abbe::sim
