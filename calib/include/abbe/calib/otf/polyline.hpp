#pragma once
/// The path of a run as geometry: lengths, nearest points, and whether a run along it can be
/// identified at all. Pure.

#include <span>
#include <vector>

#include "abbe/calib/error.hpp"
#include "abbe/calib/otf/run.hpp"

namespace abbe::calib::otf {

/// Closest point to `p_m` on the line of the leg from `from_m` to `to_m`, not clamped to its ends.
/// The leg has a length.
struct LegPoint {
  Vector3 closest_m = Vector3::Zero();
  double along_m = 0.0;  ///< from the beginning of the leg
};
[[nodiscard]] LegPoint closest_on_leg(const Vector3& from_m, const Vector3& to_m,
                                      const Vector3& p_m);

/// Where `p_m` is seen from the leg itself, ends included; a leg may be a point.
struct OnLeg {
  double off_m = 0.0;    ///< distance to the nearest point of the leg
  double along_m = 0.0;  ///< of that point, from the beginning of the leg
};
[[nodiscard]] OnLeg nearest_on_leg(const Vector3& from_m, const Vector3& to_m, const Vector3& p_m);

/// To the nearest leg; infinite for less than two vertices.
[[nodiscard]] double distance_to_path_m(const Path&, const Vector3& p_m);

/// Length of the path up to each vertex: 0 first, the length of the whole path last.
[[nodiscard]] std::vector<double> lengths_to_vertices_m(const Path&);

/// Weighted by length: a mean over time would be drawn to where the machine dwells and to slow
/// corners.
struct Centroid {
  Vector3 centre_m = Vector3::Zero();  ///< not finite for a length of 0
  double length_m = 0.0;
};
[[nodiscard]] Centroid centroid(std::span<const Vector3> polyline_m);

/// What any run along this path needs. BadInput: fewer than three vertices, two in a row the same.
/// NotFinite: a vertex is no number. DegenerateGeometry: start, end and centroid on a line, where
/// the rough alignment stands on.
[[nodiscard]] Result<void> check(const Path&);
/// The same, and BadInput for a vertex outside the travel of the axes. To be asked before the
/// machine drives.
[[nodiscard]] Result<void> check(const Path&, const MachineNodes& travel);

}  // namespace abbe::calib::otf
