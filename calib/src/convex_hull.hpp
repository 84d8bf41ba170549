#pragma once
/// Convex hull of points in space. Quickhull [Barber 1996] on a lattice: coordinates are rounded to
/// 2^-39 of the extent (2 pm on a metre), so that on which side of a plane a point lies is an exact
/// integer. The same points give the same hull on every processor, and no arrangement of coplanar
/// points breaks it.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/validity_volume.hpp"

namespace abbe::calib {

/// Indices, ascending, of points whose hull lies within `tolerance_m` of all others. Of points on
/// an edge or in a face only its ends are taken. Given these points alone, the same ones are found.
/// Empty if the points are in one plane within `tolerance_m`. n log n; n^2 of the points found
/// where these lie between others.
[[nodiscard]] std::vector<std::size_t> hull_corners(std::span<const Vector3> points_m,
                                                    double tolerance_m);

/// Half spaces whose intersection is the hull of all the points. Empty if they are in one plane. n
/// log n.
[[nodiscard]] std::vector<HalfSpace> hull_faces(std::span<const Vector3> points_m);

}  // namespace abbe::calib
