#include "abbe/sim/tracker_drift.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {

TrackerDrift TrackerDrift::linear(const Eigen::Vector3d& at_end_m) {
  TrackerDrift drift;
  drift.nodes_m_ = {Eigen::Vector3d::Zero(), at_end_m};
  return drift;
}

TrackerDrift TrackerDrift::random_walk(const Eigen::Vector3d& at_end_m, std::uint64_t seed) {
  constexpr std::size_t kSteps = 1000;
  const Eigen::Vector3d step_m = at_end_m / std::sqrt(static_cast<double>(kSteps));
  TrackerDrift drift;
  drift.nodes_m_.emplace_back(Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < kSteps; ++i) {
    Eigen::Vector3d next = drift.nodes_m_.back();
    for (int k = 0; k < 3; ++k)
      next(k) +=
          step_m(k) * gaussian(seed, NoiseStream::Drift, 3 * i + static_cast<std::size_t>(k));
    drift.nodes_m_.push_back(next);
  }
  return drift;
}

Eigen::Vector3d TrackerDrift::at(double share) const {
  if (nodes_m_.empty() || !(share > 0.0)) return Eigen::Vector3d::Zero();
  const auto steps = nodes_m_.size() - 1;
  const double place = std::min(share, 1.0) * static_cast<double>(steps);
  const auto before = std::min(static_cast<std::size_t>(place), steps - 1);
  const double part = place - static_cast<double>(before);
  return (1.0 - part) * nodes_m_[before] + part * nodes_m_[before + 1];
}

}  // namespace abbe::sim
