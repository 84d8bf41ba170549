#pragma once
/// Drift of the tracker over a run: what a fixed point seems to move, tracker frame. Pure.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace abbe::sim {

class TrackerDrift {
 public:
  TrackerDrift() = default;  ///< none
  /// In proportion to the time.
  [[nodiscard]] static TrackerDrift linear(const Eigen::Vector3d& at_end_m);
  /// Random walk in 1000 steps; `at_end_m`: its standard deviation at the end, per axis.
  [[nodiscard]] static TrackerDrift random_walk(const Eigen::Vector3d& at_end_m,
                                                std::uint64_t seed);

  /// `share`: elapsed part of the duration of the motion. 0 before the start; constant after the
  /// end.
  [[nodiscard]] Eigen::Vector3d at(double share) const;

 private:
  std::vector<Eigen::Vector3d> nodes_m_;  ///< evenly spaced in time
};

}  // namespace abbe::sim
