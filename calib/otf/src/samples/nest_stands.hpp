#pragma once
/// Finds places near reference nests at which a target stands still in the stream of the tracker,
/// and decides whether it is the machine's target (nest_visits.hpp).

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/otf/samples/nest_visits.hpp"

namespace abbe::calib::otf {

/// Valid samples within the radius of a nest: indices in the stream.
struct NearNest {
  std::size_t nest = 0;
  std::vector<std::size_t> samples;
};

/// A group of samples in which the target stands still.
struct Stand {
  NearNest group;
  std::vector<std::size_t> samples{};  ///< samples at which it stands still
  Vector3 mean_m = Vector3::Zero();
  bool goes_on = false;  ///< the target moved into or out of the group without the time that the
                         ///< beam needs to change the target
};

/// Finds the stands, in the order of time.
[[nodiscard]] std::vector<Stand> stands_near(std::span<const TrackerObservation>,
                                             const std::vector<Nest>&, const Noise&);
/// True if the machine's target moves continuously into or out of this place, in this stand or in
/// another one.
[[nodiscard]] bool is_of_machine(const Stand&, const std::vector<Stand>& all);

/// Covariance of one sample.
[[nodiscard]] Matrix3 noise_of_sample(const Vector3& p_tracker_m, const Noise&);
[[nodiscard]] Vector3 mean_position(std::span<const TrackerObservation> samples,
                                    std::span<const std::size_t> of);

}  // namespace abbe::calib::otf
