#pragma once
/// The volume a model's data covered: the convex hull of axis positions. Outside, a model
/// extrapolates.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib {

struct HalfSpace {
  Vector3 outward;  ///< unit length
  double offset_m;  ///< outward . p <= offset_m inside
};

/// Immutable value; cheap to query. The vertices alone determine what is inside, so that a volume
/// stored by its vertices is the same volume when it is read.
class ValidityVolume {
 public:
  /// Slack of contains(): a machine at the edge of its travel reads a little beyond it.
  static constexpr double kTolerance_m = 1e-6;

  ValidityVolume() = default;  ///< contains nothing
  /// Hull of at least 4 points that are not in one plane, else DegenerateGeometry. Its vertices are
  /// those of the points that stand out by more than 1 nm: of the points in a face or on an edge,
  /// its corners. 5,000 vertices take 0.1 s.
  [[nodiscard]] static Result<ValidityVolume> hull_of(std::span<const Vector3> axis_positions_m);
  /// From vertices_m() of another one, all of which are kept: contains() gives the same answers.
  /// Any other points are vertices too, wherever they lie.
  [[nodiscard]] static Result<ValidityVolume> of_vertices(std::span<const Vector3> vertices_m);

  [[nodiscard]] bool contains(const Vector3& axis_position_m) const;
  /// In ascending order of x, then y, then z.
  [[nodiscard]] std::span<const Vector3> vertices_m() const { return vertices_m_; }

 private:
  explicit ValidityVolume(std::vector<Vector3> vertices_m);

  std::vector<HalfSpace> faces_;
  std::vector<Vector3> vertices_m_;
};

/// At most `most` of the points, spread evenly: again and again the one farthest from those chosen,
/// beginning with the one farthest from their mean. In the order they had; all of them if they are
/// no more.
[[nodiscard]] std::vector<Vector3> spread_subset(std::span<const Vector3> points_m,
                                                 std::size_t most);

}  // namespace abbe::calib
