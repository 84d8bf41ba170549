#pragma once
/// Bounding box of points, and coordinates scaled so that the box is -1 to 1.

#include <span>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::verify {

struct Extent {
  Vector3 centre_m = Vector3::Zero();
  Vector3 half_width_m = Vector3::Ones();
  [[nodiscard]] Vector3 scaled(const Vector3& p_m) const {
    return (p_m - centre_m).cwiseQuotient(half_width_m);
  }
  [[nodiscard]] double diagonal_m() const { return 2.0 * half_width_m.norm(); }
};

/// Computes the box. DegenerateGeometry unless the points span a volume: in scaled coordinates,
/// their smallest principal extent must be more than 1/1000 of the largest. TooFewObservations for
/// fewer than 4 points.
[[nodiscard]] Result<Extent> extent_of(std::span<const Vector3> points_m);

}  // namespace abbe::calib::verify
