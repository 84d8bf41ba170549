#include "abbe/calib/geometry/validity_volume.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "convex_hull.hpp"

namespace abbe::calib {
namespace {

/// Points closer than this to a plane count as points of the plane. 1 nm is far below the accuracy
/// of a position (1 um) and far above rounding.
constexpr double kFlat_m = 1e-9;

bool by_coordinates(const Vector3& a, const Vector3& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

std::vector<Vector3> distinct(std::span<const Vector3> points) {
  std::vector<Vector3> sorted(points.begin(), points.end());
  std::sort(sorted.begin(), sorted.end(), by_coordinates);
  const auto same = [](const Vector3& a, const Vector3& b) { return (a - b).norm() < kFlat_m; };
  sorted.erase(std::unique(sorted.begin(), sorted.end(), same), sorted.end());
  return sorted;
}

tl::unexpected<Error> flat(std::size_t points) {
  return failure(ErrorCode::DegenerateGeometry,
                 message("validity volume: ", points, " distinct points do not span a volume"));
}

Result<void> check_finite(std::span<const Vector3> points) {
  if (!std::all_of(points.begin(), points.end(), [](const Vector3& p) { return p.allFinite(); })) {
    return failure(ErrorCode::NotFinite, "validity volume: a point is not a number");
  }
  return {};
}

}  // namespace

ValidityVolume::ValidityVolume(std::vector<Vector3> vertices_m)
    : faces_(hull_faces(vertices_m)), vertices_m_(std::move(vertices_m)) {}

Result<ValidityVolume> ValidityVolume::hull_of(std::span<const Vector3> axis_positions_m) {
  ABBE_TRY(check_finite(axis_positions_m));
  const std::vector<Vector3> points = distinct(axis_positions_m);
  std::vector<Vector3> vertices;
  for (const std::size_t i : hull_corners(points, kFlat_m)) {
    vertices.push_back(points[i]);
  }
  return vertices.empty() ? flat(points.size()) : of_vertices(vertices);
}

Result<ValidityVolume> ValidityVolume::of_vertices(std::span<const Vector3> vertices_m) {
  ABBE_TRY(check_finite(vertices_m));
  std::vector<Vector3> sorted(vertices_m.begin(), vertices_m.end());
  std::sort(sorted.begin(), sorted.end(), by_coordinates);
  const std::size_t points = sorted.size();
  ValidityVolume volume(std::move(sorted));
  if (volume.faces_.empty()) {
    return flat(points);
  }
  return volume;
}

bool ValidityVolume::contains(const Vector3& p) const {
  if (faces_.empty()) {
    return false;
  }
  return std::all_of(faces_.begin(), faces_.end(), [&](const HalfSpace& f) {
    return f.outward.dot(p) <= f.offset_m + kTolerance_m;
  });
}

std::vector<Vector3> spread_subset(std::span<const Vector3> points_m, std::size_t most) {
  if (points_m.size() <= most) {
    return {points_m.begin(), points_m.end()};
  }

  Vector3 mean = Vector3::Zero();
  for (const Vector3& p : points_m) {
    mean += p / static_cast<double>(points_m.size());
  }

  // Distance of each point to the nearest selected point; before a point is selected, to the mean.
  std::vector<double> distance_m;
  for (const Vector3& p : points_m) {
    distance_m.push_back((p - mean).norm());
  }

  std::vector<bool> chosen(points_m.size(), false);
  for (std::size_t n = 0; n < most; ++n) {
    const auto farthest = static_cast<std::size_t>(
        std::max_element(distance_m.begin(), distance_m.end()) - distance_m.begin());
    chosen[farthest] = true;
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      const double to_it_m = (points_m[i] - points_m[farthest]).norm();
      distance_m[i] = n == 0 ? to_it_m : std::min(distance_m[i], to_it_m);
    }
  }

  std::vector<Vector3> subset;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    if (chosen[i]) {
      subset.push_back(points_m[i]);
    }
  }

  return subset;
}

}  // namespace abbe::calib
