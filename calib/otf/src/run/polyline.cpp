#include "abbe/calib/otf/run/polyline.hpp"

#include <algorithm>
#include <limits>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::otf {

LegPoint closest_on_leg(const Vector3& from_m, const Vector3& to_m, const Vector3& p_m) {
  const Vector3 direction = (to_m - from_m).normalized();
  const double along_m = direction.dot(p_m - from_m);
  return {from_m + along_m * direction, along_m};
}

OnLeg nearest_on_leg(const Vector3& from_m, const Vector3& to_m, const Vector3& p_m) {
  const Vector3 leg = to_m - from_m;
  const double length_m = leg.norm();
  if (!(length_m > 0.0)) {
    return {(p_m - from_m).norm(), 0.0};
  }
  const Vector3 direction = leg / length_m;
  const double along_m = std::clamp(direction.dot(p_m - from_m), 0.0, length_m);
  return {(p_m - from_m - along_m * direction).norm(), along_m};
}

double distance_to_path_m(const Path& path, const Vector3& p_m) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < path.vertices_m.size(); ++i) {
    nearest =
        std::min(nearest, nearest_on_leg(path.vertices_m[i - 1], path.vertices_m[i], p_m).off_m);
  }
  return nearest;
}

std::vector<double> lengths_to_vertices_m(const Path& path) {
  std::vector<double> lengths(path.vertices_m.size(), 0.0);
  for (std::size_t i = 1; i < lengths.size(); ++i) {
    lengths[i] = lengths[i - 1] + (path.vertices_m[i] - path.vertices_m[i - 1]).norm();
  }
  return lengths;
}

Centroid centroid(std::span<const Vector3> polyline_m) {
  Centroid c;
  for (std::size_t i = 0; i + 1 < polyline_m.size(); ++i) {
    const double length = (polyline_m[i + 1] - polyline_m[i]).norm();
    c.centre_m += 0.5 * length * (polyline_m[i] + polyline_m[i + 1]);
    c.length_m += length;
  }
  c.centre_m /= c.length_m;
  return c;
}

Result<void> check(const Path& path) {
  for (std::size_t i = 0; i < path.vertices_m.size(); ++i) {
    if (!path.vertices_m[i].allFinite()) {
      return failure(ErrorCode::NotFinite, message("path: vertex ", i, " is not a number"));
    }
  }

  if (path.vertices_m.size() < 3) {
    return failure(ErrorCode::BadInput,
                   message("path: ", path.vertices_m.size(), " vertices, needs at least 3"));
  }

  for (std::size_t i = 0; i + 1 < path.vertices_m.size(); ++i) {
    if (path.vertices_m[i] == path.vertices_m[i + 1]) {
      return failure(ErrorCode::BadInput,
                     message("path: vertices ", i, " and ", i + 1, " coincide"));
    }
  }

  const Vector3 &start = path.vertices_m.front(), &end = path.vertices_m.back();
  const Vector3 centre = centroid(path.vertices_m).centre_m;
  const Vector3 to_centre = centre - start, to_end = end - start;

  // If the directions from the start to the centroid and to the end differ by less than 1 degree,
  // the rotation about this line would be determined by the errors of the machine.
  constexpr double kCollinear = 0.017;
  if (to_centre.cross(to_end).norm() <= kCollinear * to_centre.norm() * to_end.norm()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("path: start (", start.transpose(), "), end (", end.transpose(),
                           ") and centroid (", centre.transpose(), ") m lie on a line"));
  }

  return {};
}

Result<void> check(const Path& path, const MachineNodes& travel) {
  const std::vector<OutsideTravel> outside = outside_travel(path.vertices_m, travel);
  if (!outside.empty()) {
    const auto [vertex, axis] = outside.front();
    const auto& nodes_m = travel[axis].nodes_m;
    return failure(
        ErrorCode::BadInput,
        message("path: vertex ", vertex, " at ", "XYZ"[axis], " ",
                1e3 * path.vertices_m[vertex][static_cast<Eigen::Index>(axis)],
                " mm, the axis travels ", 1e3 * nodes_m.front(), " to ", 1e3 * nodes_m.back(),
                " mm", corrections_inside_travel(path.vertices_m, travel)));
  }
  return check(path);
}

}  // namespace abbe::calib::otf
