#pragma once
/// A machine with smooth random errors, drawn from a seed and scaled to the requested mean |V| over
/// the working volume; V is the error of the target, actual - nominal. The errors contain no
/// rigid-body motion of the target: positioning and rotations are 0 at the reference position, and
/// the straightness at the target is 0 at both ends of the axis. V is therefore what a calibration
/// with the usual conventions reports, except for the second order of the transforms (0.05 um at
/// 100 um).

#include <cstdint>

#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

struct RandomTruthOptions {
  std::uint64_t seed = 1;
  double mean_error_m = 100e-6;
  double node_spacing_m = 0.05;  ///< spacing, rounded so that whole cells fill each axis
  double beyond_m = 0.0;         ///< the nodes extend this far beyond each end of the axis
  Shape shape = Shape::Linear;
  /// Number of sine waves in each error function, 1 to 4. The shortest has a wavelength of 2 /
  /// harmonics of the axis.
  std::uint64_t harmonics = 4;
  /// Standard deviation of the backlash of translations, m. For rotations the same number is used,
  /// in rad.
  double backlash_m = 0.0;
};

/// Fills errors, squareness and backlash of `machine`, whose ranges (min < max), order and target
/// offset are kept.
[[nodiscard]] TruthMachine random_truth(TruthMachine machine, const RandomTruthOptions& options);

/// Mean |V| over a tensor grid of n points per axis over the working volume, m.
[[nodiscard]] double mean_error_m(const TruthMachine& truth, std::size_t points_per_axis = 9);

}  // namespace abbe::sim
