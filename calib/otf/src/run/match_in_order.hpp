#pragma once
/// Assignment of two sequences of points in which either may have points that the other does not
/// have.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::otf {

/// A point of the first sequence. `preference`: 0 to 1; of points at the same place the one with
/// the highest preference is matched.
struct MeasuredPlace {
  Vector3 p_m = Vector3::Zero();
  double preference = 0.0;
};

struct OrderedMatch {
  /// For each nominal point the index of the measured point; nullopt: none.
  std::vector<std::optional<std::size_t>> measured_of;
  std::size_t matched = 0;
};

/// Minimises the sum of (distance / tolerance)^2 over all pairs, of 1 for every unassigned point,
/// and of 0.01 (1 - preference) for every matched point. Pairs keep the order of both sequences and
/// are not farther apart than the tolerance. Time and memory are proportional to measured times
/// nominal points.
[[nodiscard]] OrderedMatch match_in_order(std::span<const MeasuredPlace> measured,
                                          std::span<const Vector3> nominal_m, double tolerance_m);

}  // namespace abbe::calib::otf
