#pragma once
/// Geometry of the path of a run: lengths, nearest points, and a check that a run along this path
/// can be identified. Pure.

#include <span>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Closest point to `p_m` on the infinite line through the leg from `from_m` to `to_m`. The length
/// of the leg must not be 0.
struct LegPoint {
  Vector3 closest_m = Vector3::Zero();
  double along_m = 0.0;  ///< distance from the beginning of the leg
};
[[nodiscard]] LegPoint closest_on_leg(const Vector3& from_m, const Vector3& to_m,
                                      const Vector3& p_m);

/// Position of a point relative to the straight line of a leg, whose length may be 0.
struct OnLeg {
  double off_m = 0.0;    ///< distance to the nearest point of the leg
  double along_m = 0.0;  ///< distance of that point from the beginning of the leg
};
[[nodiscard]] OnLeg nearest_on_leg(const Vector3& from_m, const Vector3& to_m, const Vector3& p_m);

/// Distance to the nearest leg; infinite for fewer than two vertices.
[[nodiscard]] double distance_to_path_m(const Path&, const Vector3& p_m);

/// Length of the path up to each vertex. The first value is 0, the last is the length of the path.
[[nodiscard]] std::vector<double> lengths_to_vertices_m(const Path&);

/// Centroid of a curve, each part weighted by its length. A mean over time would give too much
/// weight to standstills and slow corners.
struct Centroid {
  Vector3 centre_m = Vector3::Zero();  ///< not finite for a length of 0
  double length_m = 0.0;
};
[[nodiscard]] Centroid centroid(std::span<const Vector3> polyline_m);

/// Checks that a run along this path can be aligned. BadInput: fewer than three vertices, or two
/// consecutive vertices coincide. NotFinite: a vertex contains NaN or infinity. DegenerateGeometry:
/// start, end and centroid are on a line, so that the rough alignment is not determined.
[[nodiscard]] Result<void> check(const Path&);
/// check(Path), and BadInput for a vertex outside the travel of the axes. Call this before the
/// machine moves.
[[nodiscard]] Result<void> check(const Path&, const MachineNodes& travel);

}  // namespace abbe::calib::otf
