#pragma once
/// Values known at scattered points, wanted in between: linear within the tetrahedra of the points'
/// Delaunay triangulation, nothing outside their hull. The tetrahedron around a place is the convex
/// combination of points that makes it with the least sum of weight * |point|^2 (lifted onto a
/// paraboloid the points' lower hull is the triangulation), so it is found by a linear programme of
/// four rows and no mesh is built. Coordinates are scaled to the box of the points first: measured
/// volumes are flat.

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib::verify {

/// Value at the place = sum of weight * value at point. Weights are >= 0 and sum to 1.
struct LinearWeights {
  std::array<std::size_t, 4> point{};
  std::array<double, 4> weight{};
};

/// One for every place, in order; none for a place outside the hull. DegenerateGeometry unless the
/// points span a volume.
[[nodiscard]] Result<std::vector<std::optional<LinearWeights>>> linear_weights(
    std::span<const Vector3> points, std::span<const Vector3> places);

}  // namespace abbe::calib::verify
