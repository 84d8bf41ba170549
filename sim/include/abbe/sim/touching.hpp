#pragma once
/// Touching a ball array on a machine with errors: the path of the machine and the times at which
/// its probe makes contact. The tip contacts the true surfaces. The part program uses the true
/// position of the array: every approach is along the true normal of the surface. The machine does
/// not stop at contact. Pre-travel, bending and collisions between two touches are not simulated.
/// Pure; deterministic from the seed.

#include <cstdint>
#include <set>
#include <vector>

#include "abbe/sim/ball_array.hpp"
#include "abbe/sim/path_motion.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

struct TouchingOptions {
  std::vector<int> positions{4, 8, 3, 7, 2, 6, 1, 5};  ///< array positions, in order
  std::size_t points_per_ball = 25;
  std::size_t points_per_block = 25;
  double approach_m = 1e-3;  ///< probing begins this far before the surface
  double beyond_m = 0.3e-3;  ///< probing ends this far beyond the surface
  double probing_m_per_s = 5e-3;
  double retract_m_per_s = 20e-3;
  double travel_m_per_s = 0.2;
  double acceleration_m_per_s2 = 1.0;
  double noise_m = 3e-6;  ///< standard deviation of machine and probe along the approach, per touch
  double delay_s = 5e-6;  ///< delay from the contact to the edge
  double jitter_s = 1e-6;  ///< standard deviation of the delay from touch to touch
  std::uint64_t seed = 1;
  // Fault injection: each set contains numbers of touches in the program, counted from 0.
  std::set<std::size_t> missed;   ///< the probe does not trigger at these touches
  std::set<std::size_t> doubled;  ///< these touches are made twice at the same point
  /// these touches are preceded by a trigger in the air, 40 mm from the surface
  std::set<std::size_t> stray;
};

/// One probing move: a leg of the path and the surface that it approaches.
struct ProbingMove {
  std::size_t leg = 0;                                 ///< index of the leg of the path
  Eigen::Vector3d place_m = Eigen::Vector3d::Zero();   ///< true point on the surface
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   ///< outward normal at this point
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();  ///< centre of the ball
  double radius_m = 0.0;                               ///< radius of the ball; 0: a face
  enum class Kind : std::uint8_t { Contact, Silent, InTheAir } kind = Kind::Contact;
};

struct TouchingProgram {
  PathPlan path;
  std::vector<ProbingMove> moves;
};

/// The whole procedure, which starts at reading 0 of every axis. At every position: ball 1, block
/// 1, block 2, then ball 2 to the last ball.
[[nodiscard]] TouchingProgram plan_touching(const TruthMachine& truth, const BallArray& array,
                                            const TouchingOptions& options);

/// Times of the probe's edges, s from the start of the motion, ascending. `path` is the planned
/// path of the program.
[[nodiscard]] std::vector<double> edge_times_s(const TouchingProgram& program,
                                               const TruthMachine& truth, const PathMotion& path,
                                               double tip_radius_m, const TouchingOptions& options);

/// The scale reading at which the centre of the tip is truly at `place_m` (machine without target
/// offset).
[[nodiscard]] Eigen::Vector3d reading_at_m(const TruthMachine& truth,
                                           const Eigen::Vector3d& place_m);

}  // namespace abbe::sim
