#pragma once
/// Convex hull of points in space: Quickhull [Barber 1996] on a lattice. Coordinates are rounded to
/// 2^-39 of the extent (2 pm for 1 m). The height of a point above a plane is then an exact
/// integer. The same points give the same hull on every processor, and the algorithm is robust
/// against any arrangement of coplanar points.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/geometry/validity_volume.hpp"

namespace abbe::calib {

/// Corners of the hull: ascending indices of points such that every other point is inside their
/// hull or at most `tolerance_m` outside it. Points inside an edge or a face are not corners. With
/// the corners alone as input, the result is the same corners. Empty if the points are in one plane
/// within `tolerance_m`. O(n log n); O(k^2) for k corners if some of them have to be removed
/// because they are between other corners.
[[nodiscard]] std::vector<std::size_t> hull_corners(std::span<const Vector3> points_m,
                                                    double tolerance_m);

/// Half spaces whose intersection is the hull of all points. Empty if the points are in one plane.
/// O(n log n).
[[nodiscard]] std::vector<HalfSpace> hull_faces(std::span<const Vector3> points_m);

}  // namespace abbe::calib
