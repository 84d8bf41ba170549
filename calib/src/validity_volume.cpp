#include "abbe/calib/validity_volume.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "message.hpp"

namespace abbe::calib {
namespace {

/// Points closer than this to a plane lie in it: far below the micrometre a position means, far above
/// rounding.
constexpr double kFlat_m = 1e-9;

struct Plane {
  Vector3 outward;
  double offset_m;
};

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

bool all_below(std::span<const Vector3> points, const Plane& plane) {
  return std::all_of(points.begin(), points.end(),
                     [&](const Vector3& p) { return plane.outward.dot(p) <= plane.offset_m + kFlat_m; });
}

bool is_known(const std::vector<Plane>& planes, const Plane& plane) {
  constexpr double kSameDirection = 1e-9;
  return std::any_of(planes.begin(), planes.end(), [&](const Plane& p) {
    return (p.outward - plane.outward).norm() < kSameDirection &&
           std::abs(p.offset_m - plane.offset_m) < kFlat_m;
  });
}

/// Every plane through three points that has all others on one side. Brute force, because it does not mind
/// the many coplanar points of a lattice.
std::vector<Plane> supporting_planes(std::span<const Vector3> points) {
  std::vector<Plane> planes;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = i + 1; j < points.size(); ++j) {
      for (std::size_t k = j + 1; k < points.size(); ++k) {
        const Vector3 e1 = points[j] - points[i], e2 = points[k] - points[i];
        const Vector3 normal = e1.cross(e2);
        if (normal.norm() < kFlat_m * std::max(e1.norm(), e2.norm())) {
          continue;
        }
        const Vector3 unit = normal.normalized();
        for (const Vector3& outward : {unit, Vector3(-unit)}) {
          const Plane plane{outward, outward.dot(points[i])};
          if (all_below(points, plane) && !is_known(planes, plane)) {
            planes.push_back(plane);
          }
        }
      }
    }
  }
  return planes;
}

/// Points in the extreme along 26 directions: a first hull of few points that swallows most of the others.
std::vector<Vector3> extremes(std::span<const Vector3> points) {
  std::vector<Vector3> found;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        const Vector3 d(x, y, z);
        found.push_back(
            *std::max_element(points.begin(), points.end(),
                              [&](const Vector3& a, const Vector3& b) { return d.dot(a) < d.dot(b); }));
      }
    }
  }
  return distinct(found);
}

/// Of `points`, the farthest outside of each face; the faces of a few points meet most of the others at once.
std::vector<Vector3> farthest_outside(std::span<const Plane> planes, std::span<const Vector3> points) {
  std::vector<Vector3> found;
  for (const Plane& face : planes) {
    const auto height = [&](const Vector3& p) { return face.outward.dot(p) - face.offset_m; };
    const auto farthest =
        std::max_element(points.begin(), points.end(),
                         [&](const Vector3& a, const Vector3& b) { return height(a) < height(b); });
    if (height(*farthest) > kFlat_m) {
      found.push_back(*farthest);
    }
  }
  return distinct(found);
}

/// A vertex lies in three faces or more with independent directions.
bool is_vertex(std::span<const Plane> planes, const Vector3& p) {
  Matrix3 directions = Matrix3::Zero();
  for (const Plane& f : planes) {
    if (std::abs(f.outward.dot(p) - f.offset_m) < 2 * kFlat_m) {
      directions += f.outward * f.outward.transpose();
    }
  }
  constexpr double kIndependent = 1e-12;
  return directions.determinant() > kIndependent;
}

struct Hull {
  std::vector<Plane> planes;
  std::vector<Vector3> on_surface;
};

bool is_inside(std::span<const Plane> planes, const Vector3& p) {
  return std::all_of(planes.begin(), planes.end(),
                     [&](const Plane& f) { return f.outward.dot(p) < f.offset_m - kFlat_m; });
}

/// The hull of the extremes grows by what lies outside until nothing does, so that the brute force sees the
/// corners (8 for a box of any number of points) and not the path between them.
Hull hull_of_distinct(std::span<const Vector3> points) {
  Hull hull{{}, extremes(points)};
  std::vector<Vector3> beyond;
  do {
    hull.on_surface.insert(hull.on_surface.end(), beyond.begin(), beyond.end());
    hull.planes = supporting_planes(hull.on_surface);
    std::erase_if(hull.on_surface, [&](const Vector3& p) { return is_inside(hull.planes, p); });
    beyond = farthest_outside(hull.planes, points);
  } while (!beyond.empty());
  return hull;
}

}  // namespace

Result<ValidityVolume> ValidityVolume::hull_of(std::span<const Vector3> axis_positions_m) {
  for (const Vector3& p : axis_positions_m) {
    if (!p.allFinite()) {
      return failure(ErrorCode::NotFinite, "validity volume: a point is not a number");
    }
  }
  const std::vector<Vector3> points = distinct(axis_positions_m);
  const Hull hull = points.size() < 4 ? Hull{} : hull_of_distinct(points);
  ValidityVolume volume;
  for (const Plane& plane : hull.planes) {
    volume.faces_.push_back({plane.outward, plane.offset_m});
  }
  std::copy_if(points.begin(), points.end(), std::back_inserter(volume.vertices_m_),
               [&](const Vector3& p) { return is_vertex(hull.planes, p); });
  if (volume.faces_.size() < 4 || volume.vertices_m_.size() < 4) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("validity volume: ", points.size(), " different points do not enclose a volume"));
  }
  return volume;
}

bool ValidityVolume::contains(const Vector3& p) const {
  if (faces_.empty()) {
    return false;
  }
  return std::all_of(faces_.begin(), faces_.end(),
                     [&](const HalfSpace& f) { return f.outward.dot(p) <= f.offset_m + kTolerance_m; });
}

std::vector<Vector3> spread_subset(std::span<const Vector3> points_m, std::size_t most) {
  if (points_m.size() <= most) {
    return {points_m.begin(), points_m.end()};
  }
  Vector3 mean = Vector3::Zero();
  for (const Vector3& p : points_m) {
    mean += p / static_cast<double>(points_m.size());
  }
  // Distance to the nearest one chosen; at first to the mean, which is none of them.
  std::vector<double> distance_m;
  for (const Vector3& p : points_m) {
    distance_m.push_back((p - mean).norm());
  }
  std::vector<bool> chosen(points_m.size(), false);
  for (std::size_t n = 0; n < most; ++n) {
    const auto farthest =
        static_cast<std::size_t>(std::max_element(distance_m.begin(), distance_m.end()) - distance_m.begin());
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
