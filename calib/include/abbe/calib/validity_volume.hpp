#pragma once
/// The volume a model's data covered: the convex hull of axis positions. Outside, a model extrapolates.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib {

/// Immutable value; cheap to query.
class ValidityVolume {
 public:
  /// Slack of contains(): a machine at the edge of its travel reads a little beyond it.
  static constexpr double kTolerance_m = 1e-6;

  ValidityVolume() = default;  ///< contains nothing
  /// Hull of at least 4 points that are not in one plane, else DegenerateGeometry. Meant for up to some
  /// hundred vertices.
  [[nodiscard]] static Result<ValidityVolume> hull_of(std::span<const Vector3> axis_positions_m);

  [[nodiscard]] bool contains(const Vector3& axis_position_m) const;
  [[nodiscard]] std::span<const Vector3> vertices_m() const { return vertices_m_; }

 private:
  struct HalfSpace {
    Vector3 outward;
    double offset_m;
  };
  std::vector<HalfSpace> faces_;
  std::vector<Vector3> vertices_m_;
};

/// At most `most` of the points, spread evenly: again and again the one farthest from those chosen, beginning
/// with the one farthest from their mean. In the order they had; all of them if they are no more.
[[nodiscard]] std::vector<Vector3> spread_subset(std::span<const Vector3> points_m, std::size_t most);

}  // namespace abbe::calib
