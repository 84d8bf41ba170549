#pragma once
/// Drift of the tracker during a run: the apparent displacement of a fixed point, in the tracker
/// frame. Pure.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace abbe::sim {

class TrackerDrift {
 public:
  TrackerDrift() = default;  ///< no drift
  /// A drift proportional to the time.
  [[nodiscard]] static TrackerDrift linear(const Eigen::Vector3d& at_end_m);
  /// A random walk of 1000 steps. `at_end_m`: its standard deviation at the end, per axis.
  [[nodiscard]] static TrackerDrift random_walk(const Eigen::Vector3d& at_end_m,
                                                std::uint64_t seed);

  /// `share`: elapsed part of the duration of the motion. 0 before the start; constant after the
  /// end.
  [[nodiscard]] Eigen::Vector3d at(double share) const;

 private:
  std::vector<Eigen::Vector3d> nodes_m_;  ///< evenly spaced in time
};

}  // namespace abbe::sim
