#pragma once
/// Validity volume of a model: the convex hull of the axis positions at which its data were
/// measured. Outside this volume a model extrapolates.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

struct HalfSpace {
  Vector3 outward;  ///< outward normal of unit length
  double offset_m;  ///< a point p is inside if outward . p <= offset_m
};

/// The convex hull as half spaces and vertices; a query takes little time. The vertices alone
/// determine the volume: a volume that is stored as its vertices and read again is identical.
/// Immutable.
class ValidityVolume {
 public:
  /// Tolerance of contains(): an axis at the end of its travel can read slightly more than the
  /// nominal end of the travel.
  static constexpr double kTolerance_m = 1e-6;

  ValidityVolume() = default;  ///< a volume that contains no point
  /// Hull of at least 4 points that are not in one plane, else DegenerateGeometry. Points within
  /// 1 nm of the hull of the other points are not vertices; points inside a face or an edge are
  /// therefore left out. 5,000 vertices take 0.1 s.
  [[nodiscard]] static Result<ValidityVolume> hull_of(std::span<const Vector3> axis_positions_m);
  /// Restores a volume from its vertices_m(). Every given point is kept as a vertex, whether it is
  /// a corner of the hull or not. contains() returns the same results as that of the original
  /// volume.
  [[nodiscard]] static Result<ValidityVolume> of_vertices(std::span<const Vector3> vertices_m);

  [[nodiscard]] bool contains(const Vector3& axis_position_m) const;
  /// Vertices in ascending order of x, then y, then z.
  [[nodiscard]] std::span<const Vector3> vertices_m() const { return vertices_m_; }

 private:
  explicit ValidityVolume(std::vector<Vector3> vertices_m);

  std::vector<HalfSpace> faces_;
  std::vector<Vector3> vertices_m_;
};

/// Selects at most `most` of the points, evenly spread (farthest-point sampling). The first
/// selected point is the one farthest from the mean, each further one is the one farthest from all
/// selected points. The result keeps the order of the input. All points are returned if there are
/// at most `most`.
[[nodiscard]] std::vector<Vector3> spread_subset(std::span<const Vector3> points_m,
                                                 std::size_t most);

}  // namespace abbe::calib
