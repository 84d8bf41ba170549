#include <algorithm>
#include <cmath>
#include <limits>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/otf/observe/alignment.hpp"

namespace abbe::calib::otf {
namespace {

struct AssignableLeg {
  Vector3 from_m, direction;
  double length_m = 0.0;
};

std::vector<AssignableLeg> legs_of(const Path& path) {
  std::vector<AssignableLeg> legs;
  for (std::size_t i = 0; i + 1 < path.vertices_m.size(); ++i) {
    const Vector3 d = path.vertices_m[i + 1] - path.vertices_m[i];
    legs.push_back({path.vertices_m[i], d.normalized(), d.norm()});
  }
  return legs;
}

/// Direction of travel at point i from its two neighbours. Zero if the machine stands still; NaN or
/// zero if a neighbour is lost.
Vector3 chord(std::span<const Vector3> points, std::size_t i) {
  const Vector3 c = points[std::min(i + 1, points.size() - 1)] - points[i == 0 ? 0 : i - 1];
  const double length = c.norm();
  return length > 0 ? Vector3(c / length) : Vector3(Vector3::Zero());
}

double squared_distance(const AssignableLeg& leg, const Vector3& p) {
  const Vector3 r = p - leg.from_m;
  const double along = std::clamp(leg.direction.dot(r), 0.0, leg.length_m);
  return (r - along * leg.direction).squaredNorm();
}

/// Cost of a segment on a leg. A lost segment costs nothing on any leg; a segment without direction
/// of travel costs only its squared distance.
double cost(const AssignableLeg& leg, const Vector3& p, const Vector3& travel, double direction_m) {
  if (!p.allFinite()) {
    return 0.0;
  }
  const bool moves = travel.squaredNorm() > 0;  // false for NaN, too
  return squared_distance(leg, p) +
         (moves ? direction_m * direction_m * (1.0 - travel.dot(leg.direction)) : 0.0);
}

}  // namespace

Result<std::vector<std::size_t>> assign_legs(std::span<const Vector3> points_m, const Path& path,
                                             double direction_m) {
  const std::vector<AssignableLeg> legs = legs_of(path);
  const std::size_t n = points_m.size(), m = legs.size();
  if (m == 0 || n < m) {
    return failure(ErrorCode::TooFewObservations,
                   message("leg assignment: ", n, " segments for ", m,
                           " legs, needs at least one segment per leg"));
  }

  // Viterbi algorithm for n segments and m legs. best[j]: least cost of segments 0..i with segment
  // i on leg j; segment i - 1 is then on leg j or j - 1. n - m of the n segments are on the same
  // leg as the segment before, therefore
  //     j <= i <= j + n - m.
  // `advanced` has one bit for each such pair (i, j): segment i - 1 is on leg j - 1.
  std::vector<double> best(m, std::numeric_limits<double>::infinity());
  const std::size_t stays = n - m;
  std::vector<bool> advanced(m * (stays + 1), false);
  const auto pair = [&](std::size_t i, std::size_t j) { return j * (stays + 1) + (i - j); };
  best[0] = cost(legs[0], points_m[0], chord(points_m, 0), direction_m);

  for (std::size_t i = 1; i < n; ++i) {
    const Vector3 travel = chord(points_m, i);
    // Skip legs that segment i cannot have reached, and legs from which the remaining segments
    // cannot reach the last leg.
    const std::size_t highest = std::min(m - 1, i), lowest = i > stays ? i - stays : 0;
    for (std::size_t j = highest + 1; j-- > lowest;) {
      const bool from_before = j > 0 && best[j - 1] < best[j];
      advanced[pair(i, j)] = from_before;
      best[j] =
          (from_before ? best[j - 1] : best[j]) + cost(legs[j], points_m[i], travel, direction_m);
    }

    if (lowest > 0) {
      best[lowest - 1] = std::numeric_limits<double>::infinity();
    }
  }

  std::vector<std::size_t> leg(n);
  std::size_t j = m - 1;
  for (std::size_t i = n; i-- > 0;) {
    leg[i] = j;
    j -= advanced[pair(i, j)] ? 1 : 0;
  }

  return leg;
}

}  // namespace abbe::calib::otf
