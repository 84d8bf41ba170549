#pragma once
/// A surface that the probe touches whenever one axis moves down through it, and the delayed
/// trigger of the probe. The machine does not stop at contact; pre-travel and bending are not
/// simulated. Pure; computed from the path alone.

#include <cstdint>
#include <vector>

#include "abbe/sim/path_motion.hpp"
#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

struct TouchedSurface {
  int axis = 2;            ///< 0 to 2: X, Y, Z
  double surface_m = 0.0;  ///< scale reading at contact
  double delay_s = 5e-6;   ///< delay from the contact to the edge
  double jitter_s = 1e-6;  ///< standard deviation of the delay from touch to touch
  std::uint64_t seed = 1;
};

/// Times of the probe's edges, in s from the start of the motion, ascending.
[[nodiscard]] std::vector<double> edge_times_s(const TouchedSurface& surface,
                                               const PathMotion& path);

}  // namespace abbe::sim
