#pragma once
/// A machine nobody has seen before: smooth random errors from a seed, scaled so that the mean |V|
/// over the working volume is what was asked. The errors carry no rigid motion for the machine's
/// target offset (positioning and rotations are 0 at the reference position, straightness as the
/// target feels it is 0 at both ends of the axis), so that V is what a calibration with the usual
/// conventions reports, up to the second order of the transforms (0.05 um at 100 um).

#include <cstdint>

#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

struct RandomTruthOptions {
  std::uint64_t seed = 1;
  double mean_error_m = 100e-6;
  double node_spacing_m = 0.05;  ///< rounded so that whole cells fill each axis
  Shape shape = Shape::Linear;
  double backlash_m =
      /// standard deviation of the translations' backlash; rotations: the same number per metre,
      /// rad
      0.0;
};

/// Fills errors, squareness and backlash of `machine`, whose ranges (min < max), order and target
/// offset are kept.
[[nodiscard]] TruthMachine random_truth(TruthMachine machine, const RandomTruthOptions& options);

/// Mean |V| over a tensor grid of n points per axis over the working volume, m.
[[nodiscard]] double mean_error_m(const TruthMachine& truth, std::size_t points_per_axis = 9);

}  // namespace abbe::sim
