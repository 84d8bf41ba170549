#pragma once
/// Reference nests: fixed targets beside the machine. While the machine waits at a vertex
/// (PathPlan::wait_s), the beam goes from the machine's target to each nest in turn and back. The
/// tracker measures nothing while the beam moves. Times in s from the start of the motion. Pure.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace abbe::sim {

struct ReferenceNest {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< tracker frame
  /// From the time `moved_at_s` on, the nest is displaced by `moved_m`, as if it had been pushed.
  Eigen::Vector3d moved_m = Eigen::Vector3d::Zero();
  double moved_at_s = 0.0;
};

struct NestVisits {
  std::vector<ReferenceNest> nests{};
  double stay_s = 4.0;  ///< time at each nest
  double move_s = 1.0;  ///< time for which the beam moves from one target to the next
  /// Standard deviation of the position of a nest, per coordinate, from visit to visit.
  double repeatability_m = 3e-6;
  std::uint64_t seed = 1;

  /// Duration of a round to all nests and back; 0 without nests.
  [[nodiscard]] double round_s() const;
};

enum class BeamTarget { Machine, Nest, None };  ///< None: the beam is moving

struct Beam {
  BeamTarget target = BeamTarget::Machine;
  std::size_t nest = 0;
  std::size_t round = 0;
};

/// `rounds_s`: times at which the rounds begin, ascending.
[[nodiscard]] Beam beam_at(const NestVisits&, std::span<const double> rounds_s, double time_s);
/// True position of the nest in this round, tracker frame.
[[nodiscard]] Eigen::Vector3d nest_position_m(const NestVisits&, const Beam&, double time_s);

}  // namespace abbe::sim
