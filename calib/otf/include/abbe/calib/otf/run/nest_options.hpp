#pragma once
/// Reference nests: fixed targets beside the machine that the tracker measures between the legs of
/// a run, while the machine stands still. An apparent motion that is common to all nests is drift
/// of the tracker (tracker_drift.hpp).

#include <string>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::otf {

struct Nest {
  std::string name;
  Vector3 position_tracker_m = Vector3::Zero();  ///< approximate, tracker frame
  /// A target that stands still closer than this to the nest's position is in the nest, unless it
  /// is the machine's target (nest_visits.hpp).
  double radius_m = 10e-3;
};

struct NestOptions {
  std::vector<Nest> nests{};  ///< empty: no nests are searched
  /// Standard uncertainty of one visit of a nest, per coordinate: seating of the target, and motion
  /// of this nest alone. Public tracker data show 3 um to 4.6 um from nest to nest.
  double u_repeatability_m = 3e-6;
};

}  // namespace abbe::calib::otf
