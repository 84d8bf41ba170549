#include "convex_hull.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

namespace abbe::calib {
namespace {

__extension__ using Wide = __int128;
using WideVector = std::array<Wide, 3>;
using LatticePoint = std::array<std::int64_t, 3>;
using Index = std::size_t;

/// The lattice to which the points are rounded has at most 2^39 cells along the longest side.
/// Differences of coordinates are below 2^39, components of a cross product of two differences
/// below 2^79, heights (scalar product of a cross product and a difference) below 2^121, so that
/// all fit in 128 bits.
constexpr int kCellBits = 39;

LatticePoint minus(const LatticePoint& a, const LatticePoint& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

WideVector cross(const LatticePoint& a, const LatticePoint& b) {
  const auto component = [&](Index i, Index j) { return Wide(a[i]) * b[j] - Wide(a[j]) * b[i]; };
  return {component(1, 2), component(2, 0), component(0, 1)};
}

Wide dot(const WideVector& a, const LatticePoint& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Vector3 rounded(const WideVector& v) {
  return {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])};
}

struct Triangle {
  std::array<Index, 3> corner{};  ///< anticlockwise seen from outside
  std::array<Index, 3> beyond{};  ///< [k]: neighbour triangle at the edge from corner k to k + 1
  WideVector normal{};            ///< outward normal, exact
  double length = 0.0;            ///< length of the normal
  std::vector<Index> outside{};   ///< points assigned to this triangle; they are above it
  bool removed = false;
};

enum class ApexFrom { OwnPoints, AllPoints };

class Quickhull {
 public:
  /// Points at most `tolerance_m` above a triangle count as inside.
  Quickhull(std::span<const Vector3> points_m, double tolerance_m, ApexFrom apex_from);

  /// Points that are corners of the hull. Empty if the points are in one plane.
  [[nodiscard]] std::vector<Index> corners() const;
  [[nodiscard]] bool every_corner_protrudes() const;
  [[nodiscard]] std::vector<HalfSpace> faces() const;

 private:
  [[nodiscard]] bool round_to_lattice(std::span<const Vector3> points_m);
  [[nodiscard]] Vector3 position_cells(Index p) const {
    return {static_cast<double>(at_[p][0]), static_cast<double>(at_[p][1]),
            static_cast<double>(at_[p][2])};
  }
  [[nodiscard]] bool start_with_four();
  void add_triangle(Index a, Index b, Index c);
  /// Height of the point above the plane of t, multiplied by the length of the normal, as an exact
  /// integer; positive on the outer side.
  [[nodiscard]] Wide height(const Triangle& t, Index point) const {
    return dot(t.normal, minus(at_[point], at_[t.corner[0]]));
  }
  [[nodiscard]] double height_cells(const Triangle& t, Index point) const {
    return static_cast<double>(height(t, point)) / t.length;
  }
  template <class Height>
  [[nodiscard]] Index extreme(const std::vector<Index>& among, const Height& height) const;
  [[nodiscard]] std::vector<Index> outside_from(Index first_triangle) const;
  [[nodiscard]] Index apex_above(Index triangle) const;
  [[nodiscard]] std::vector<Index> remove_visible(Index apex, Index from);
  void assign(const std::vector<Index>& points, Index first_triangle);
  void add_apex(Index apex, Index from);
  void grow();
  [[nodiscard]] bool repeats_a_neighbour(Index triangle) const;

  std::vector<LatticePoint> at_;
  Vector3 low_m_ = Vector3::Zero();
  double cell_m_ = 0.0;
  double tolerance_cells_ = 0.0;
  ApexFrom apex_from_;
  std::vector<Triangle> triangles_;
  /// For each point: the triangle added last whose edge to a kept triangle begins at this point.
  std::vector<Index> begins_at_;
  /// Points that are above a triangle by less than the tolerance and are therefore assigned to
  /// none.
  std::vector<Index> close_;
};

Quickhull::Quickhull(std::span<const Vector3> points_m, double tolerance_m, ApexFrom apex_from)
    : apex_from_(apex_from), begins_at_(points_m.size()) {
  if (points_m.size() < 4 || !round_to_lattice(points_m)) {
    return;
  }
  // A tolerance of less than a few cells of the lattice would be smaller than the rounding of the
  // coordinates.
  constexpr double kLeastCells = 4.0;
  tolerance_cells_ = tolerance_m > 0.0 ? std::max(kLeastCells, tolerance_m / cell_m_) : 0.0;
  if (start_with_four()) {
    grow();
  }
}

bool Quickhull::round_to_lattice(std::span<const Vector3> points_m) {
  Vector3 high_m = low_m_ = points_m.front();
  for (const Vector3& p : points_m) {
    low_m_ = low_m_.cwiseMin(p);
    high_m = high_m.cwiseMax(p);
  }

  const double extent_m = (high_m - low_m_).maxCoeff();
  if (!(extent_m > 0.0) || !std::isfinite(extent_m)) {
    return false;
  }

  cell_m_ = std::ldexp(1.0, std::ilogb(extent_m) + 1 - kCellBits);
  if (!std::isnormal(cell_m_)) {
    return false;
  }

  for (const Vector3& p : points_m) {
    const Vector3 cells = (p - low_m_) / cell_m_;
    at_.push_back({std::llround(cells.x()), std::llround(cells.y()), std::llround(cells.z())});
  }

  return true;
}

/// The highest of the points. If several are equally high (a face or an edge parallel to the
/// plane), the one with the least x, then y, then z is selected: it is a corner of the hull and not
/// a point between two corners. "Equally high" means within half the tolerance: if the highest
/// point is above the plane by more than the tolerance, the selected point is above the plane, too.
template <class Height>
Index Quickhull::extreme(const std::vector<Index>& among, const Height& height) const {
  std::vector<Index> left = among;
  const auto keep_highest = [&](const auto& value) {
    std::vector<double> values(left.size());
    std::transform(left.begin(), left.end(), values.begin(), value);
    const double least = *std::max_element(values.begin(), values.end()) - 0.5 * tolerance_cells_;
    std::vector<Index> kept;
    for (Index i = 0; i < left.size(); ++i) {
      if (values[i] >= least) {
        kept.push_back(left[i]);
      }
    }
    left = std::move(kept);
  };

  keep_highest(height);
  for (Index axis = 0; axis < 3 && left.size() > 1; ++axis) {
    keep_highest([&](Index p) { return -static_cast<double>(at_[p][axis]); });
  }

  return left.front();
}

/// Starts with a tetrahedron of four extreme points that span a volume. False if there is none.
bool Quickhull::start_with_four() {
  std::vector<Index> all(at_.size());
  std::iota(all.begin(), all.end(), Index{0});
  const auto position = [&](Index p) { return position_cells(p); };

  const auto farthest = [&](const auto& distance) {
    return *std::max_element(all.begin(), all.end(),
                             [&](Index a, Index b) { return distance(a) < distance(b); });
  };

  const Index a = extreme(all, [&](Index p) { return -static_cast<double>(at_[p][0]); });
  const Index b = farthest([&](Index p) { return (position(p) - position(a)).norm(); });
  const Vector3 along = (position(b) - position(a)).normalized();

  const auto across = [&](Index p) {
    const Vector3 d = position(p) - position(a);
    return Vector3(d - along * along.dot(d));
  };

  const Vector3 side = across(farthest([&](Index p) { return across(p).norm(); }));
  if (!(side.norm() > tolerance_cells_)) {
    return false;
  }

  const Index c =
      extreme(all, [&](Index p) { return side.normalized().dot(position(p) - position(a)); });
  add_triangle(a, b, c);
  const Triangle base = triangles_.front();
  triangles_.clear();

  if (!(base.length > 0.0)) {
    return false;
  }

  const Index far = farthest([&](Index p) { return std::abs(height_cells(base, p)); });
  if (height(base, far) == 0 || !(std::abs(height_cells(base, far)) > tolerance_cells_)) {
    return false;
  }

  const bool is_above = height(base, far) > 0;
  const Index d =
      extreme(all, [&](Index p) { return (is_above ? 1.0 : -1.0) * height_cells(base, p); });
  const auto [first, second] = is_above ? std::pair{b, a} : std::pair{a, b};
  add_triangle(first, second, c);  // d is below this triangle
  add_triangle(second, first, d);
  add_triangle(c, second, d);
  add_triangle(first, c, d);
  triangles_[0].beyond = {1, 2, 3};
  triangles_[1].beyond = {0, 3, 2};
  triangles_[2].beyond = {0, 1, 3};
  triangles_[3].beyond = {0, 2, 1};
  assign(all, 0);

  return true;
}

void Quickhull::add_triangle(Index a, Index b, Index c) {
  Triangle t;
  t.corner = {a, b, c};
  t.normal = cross(minus(at_[b], at_[a]), minus(at_[c], at_[a]));
  t.length = rounded(t.normal).norm();
  triangles_.push_back(std::move(t));
}

/// Assigns every point to the first triangle, from `first_triangle` on, above which it lies by
/// more than the tolerance.
void Quickhull::assign(const std::vector<Index>& points, Index first_triangle) {
  for (const Index p : points) {
    bool is_above = false;
    Index t = first_triangle;
    for (; t < triangles_.size(); ++t) {
      if (triangles_[t].removed || height(triangles_[t], p) <= 0) {
        continue;
      }
      is_above = true;
      if (height_cells(triangles_[t], p) > tolerance_cells_) {
        triangles_[t].outside.push_back(p);
        break;
      }
    }
    if (t == triangles_.size() && is_above) {
      close_.push_back(p);
    }
  }
}

std::vector<Index> Quickhull::outside_from(Index first_triangle) const {
  std::vector<Index> points;
  for (Index t = first_triangle; t < triangles_.size(); ++t) {
    points.insert(points.end(), triangles_[t].outside.begin(), triangles_[t].outside.end());
  }
  return points;
}

/// Selects the next point to add above a triangle that has points assigned.
Index Quickhull::apex_above(Index triangle) const {
  const Triangle& t = triangles_[triangle];
  const auto above = [&](Index p) { return height_cells(t, p); };
  // Of points on an edge the corner at its end must be selected. This corner may be assigned to
  // another triangle than the points on the edge. AllPoints therefore searches the points of all
  // triangles.
  return apex_from_ == ApexFrom::AllPoints ? extreme(outside_from(triangle), above)
                                           : extreme(t.outside, above);
}

/// Removes the triangles that have the apex strictly on their outer side, and returns them. These
/// triangles are connected; their boundary is one closed polygon.
std::vector<Index> Quickhull::remove_visible(Index apex, Index from) {
  std::vector<Index> visible{from};
  triangles_[from].removed = true;
  for (Index i = 0; i < visible.size(); ++i) {
    const std::array<Index, 3> beyond = triangles_[visible[i]].beyond;
    for (const Index next : beyond) {
      if (!triangles_[next].removed && height(triangles_[next], apex) > 0) {
        triangles_[next].removed = true;
        visible.push_back(next);
      }
    }
  }
  return visible;
}

/// Replaces the triangles below the apex with triangles from their boundary to the apex.
void Quickhull::add_apex(Index apex, Index from) {
  const std::vector<Index> visible = remove_visible(apex, from);
  const Index first_new = triangles_.size();
  for (const Index v : visible) {
    for (Index k = 0; k < 3; ++k) {
      const Index old = triangles_[v].beyond[k];
      if (triangles_[old].removed) {
        continue;
      }
      const Index a = triangles_[v].corner[k], b = triangles_[v].corner[(k + 1) % 3];
      const Index added = triangles_.size();
      add_triangle(a, b, apex);
      triangles_[added].beyond[0] = old;
      begins_at_[a] = added;
      Triangle& other = triangles_[old];
      for (Index e = 0; e < 3; ++e) {
        if (other.corner[e] == b && other.corner[(e + 1) % 3] == a) {
          other.beyond[e] = added;
        }
      }
    }
  }

  for (Index t = first_new; t < triangles_.size(); ++t) {
    const Index next = begins_at_[triangles_[t].corner[1]];
    triangles_[t].beyond[1] = next;
    triangles_[next].beyond[2] = t;
  }

  for (const Index v : visible) {
    const std::vector<Index> points = std::exchange(triangles_[v].outside, {});
    assign(points, first_new);
  }
}

void Quickhull::grow() {
  do {
    for (Index t = 0; t < triangles_.size(); ++t) {
      while (!triangles_[t].removed && !triangles_[t].outside.empty()) {
        add_apex(apex_above(t), t);
      }
    }
    // The points in close_ are within the tolerance of the triangles tested so far. They may be
    // above another triangle by more than the tolerance, and are tested against all triangles here.
    assign(std::exchange(close_, {}), 0);
  } while (!outside_from(0).empty());
}

std::vector<Index> Quickhull::corners() const {
  std::vector<Index> found;
  for (const Triangle& t : triangles_) {
    if (!t.removed) {
      found.insert(found.end(), t.corner.begin(), t.corner.end());
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

/// True if every corner protrudes by more than the tolerance over all its neighbour corners, in the
/// direction of the mean normal of the triangles around it. Such a corner is outside the hull of
/// all other corners, so that the selection of corners needs no further check.
bool Quickhull::every_corner_protrudes() const {
  std::vector<Vector3> along(at_.size(), Vector3::Zero());
  const auto each_corner = [&](const auto& act) {
    for (const Triangle& t : triangles_) {
      for (Index k = 0; k < 3 && !t.removed; ++k) {
        act(t, t.corner[k], t.corner[(k + 1) % 3], t.corner[(k + 2) % 3]);
      }
    }
  };

  each_corner([&](const Triangle& t, Index at, Index, Index) {
    along[at] += rounded(t.normal) / t.length;
  });

  bool all = true;
  each_corner([&](const Triangle&, Index at, Index next, Index last) {
    const Vector3 d = along[at].normalized();
    for (const Index beside : {next, last}) {
      all = all && d.dot(position_cells(at) - position_cells(beside)) > tolerance_cells_;
    }
  });

  return all;
}

/// True if the triangle is in the plane of a neighbour triangle with a lower index.
bool Quickhull::repeats_a_neighbour(Index triangle) const {
  const Triangle& t = triangles_[triangle];
  return std::any_of(t.beyond.begin(), t.beyond.end(), [&](Index n) {
    const std::array<Index, 3>& corners = triangles_[n].corner;
    return n < triangle &&
           std::all_of(corners.begin(), corners.end(), [&](Index p) { return height(t, p) == 0; });
  });
}

std::vector<HalfSpace> Quickhull::faces() const {
  std::vector<HalfSpace> found;
  for (Index i = 0; i < triangles_.size(); ++i) {
    const Triangle& t = triangles_[i];
    if (t.removed || repeats_a_neighbour(i)) {
      continue;
    }
    const Vector3 outward = rounded(t.normal).normalized();
    found.push_back({outward, outward.dot(low_m_ + cell_m_ * position_cells(t.corner[0]))});
  }
  return found;
}

}  // namespace

std::vector<std::size_t> hull_corners(std::span<const Vector3> points_m, double tolerance_m) {
  const Quickhull hull(points_m, tolerance_m, ApexFrom::OwnPoints);
  std::vector<std::size_t> found = hull.corners();
  bool settled = hull.every_corner_protrudes();

  // Some of the corners found may lie between other corners: the hull of the corners found is
  // computed repeatedly until no corner is removed.
  while (!settled) {
    std::vector<Vector3> some;
    for (const std::size_t i : found) {
      some.push_back(points_m[i]);
    }
    const Quickhull again(some, tolerance_m, ApexFrom::AllPoints);
    std::vector<std::size_t> kept = again.corners();
    settled = kept.size() == found.size() || again.every_corner_protrudes();
    std::transform(kept.begin(), kept.end(), kept.begin(), [&](std::size_t i) { return found[i]; });
    found = std::move(kept);
  }

  return found;
}

std::vector<HalfSpace> hull_faces(std::span<const Vector3> points_m) {
  return Quickhull(points_m, 0.0, ApexFrom::OwnPoints).faces();
}

}  // namespace abbe::calib
