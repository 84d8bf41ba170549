#pragma once
/// Interpolates values at scattered points p_i. The interpolation is linear within the tetrahedra
/// of the Delaunay triangulation of the points; no value outside their convex hull. The
/// interpolation weights w_i at a place x, nonzero only at the corners of the tetrahedron that
/// contains x, solve
///     minimise sum w_i |p_i|^2   subject to   sum w_i p_i = x,  sum w_i = 1,  w_i >= 0
/// because the triangulation is the lower hull of the points lifted onto a paraboloid. This is a
/// linear programme with four constraints; no mesh is built. Coordinates are first scaled to the
/// bounding box of the points, because measured volumes are often flat.

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::verify {

/// Interpolated value at a place = sum of weight[k] * value at point[k]. Weights are >= 0 and their
/// sum is 1.
struct LinearWeights {
  std::array<std::size_t, 4> point{};
  std::array<double, 4> weight{};
};

/// Computes the weights: one result per place, in the same order; nullopt for a place outside the
/// hull. DegenerateGeometry unless the points span a volume.
[[nodiscard]] Result<std::vector<std::optional<LinearWeights>>> linear_weights(
    std::span<const Vector3> points, std::span<const Vector3> places);

}  // namespace abbe::calib::verify
