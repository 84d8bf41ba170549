#pragma once
/// The file verification.csv of a simulated machine, for `abbe verify`.

#include <string>

#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

/// The text of the file: readings on a grid over the travel, and the true position of the target
/// there, in machine coordinates.
[[nodiscard]] std::string verification_csv(const TruthMachine& machine);

}  // namespace abbe::sim
