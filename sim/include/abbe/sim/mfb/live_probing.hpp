#pragma once
/// The touches of a Multi-Feature Bar as a motion of the machine and edges of its probe, for
/// devices on their wires. The machine passes the reading of every touch (probing.hpp) on a
/// straight approach along the normal of the surface; the edge follows `delay_s` later. Therefore
/// the devices send the readings of points.csv, within jitter x feed. Collisions between two
/// touches are not simulated. Pure; deterministic from the seed.

#include <cstdint>
#include <set>
#include <vector>

#include "abbe/sim/mfb/probing.hpp"
#include "abbe/sim/path_motion.hpp"

namespace abbe::sim::mfb {

struct LiveProbing {
  double approach_m = 0.3e-3;  ///< probing begins this far before the surface
  double beyond_m = 0.1e-3;    ///< probing ends this far beyond the surface
  double probing_m_per_s = 4e-3;
  double retract_m_per_s = 50e-3;
  double travel_m_per_s = 0.3;
  double acceleration_m_per_s2 = 5.0;
  double delay_s = 5e-6;   ///< delay from the contact to the edge
  double jitter_s = 1e-6;  ///< standard deviation of the delay from touch to touch
  std::uint64_t seed = 1;
  // Fault injection: each set contains numbers of touches in the program, counted from 0.
  std::set<std::size_t> missed;   ///< the probe does not trigger at these touches
  std::set<std::size_t> doubled;  ///< these touches are made twice at the same point
  /// these touches are preceded by a trigger in the air, 40 mm from the surface
  std::set<std::size_t> stray;
};

struct LiveProgram {
  PathPlan path;
  std::vector<double> edges_s;  ///< edges of the probe, s from the start of the motion, ascending
};

/// The program, which starts at reading 0 of every axis. BadInput for a feed or an acceleration
/// that is not positive.
[[nodiscard]] Result<LiveProgram> live_program(const ProbedBar& probed, const LiveProbing& options);

}  // namespace abbe::sim::mfb
