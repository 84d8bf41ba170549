#include "abbe/calib/internal/mfb/observe/bar_points.hpp"

#include <array>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::mfb {
namespace {

/// Computes the point at which an axis meets a plane; false if they are nearly parallel.
bool meet(const PointAndDirection& axis, const PointAndDirection& plane, Vector3& at) {
  constexpr double kParallel = 0.1;  // sine of the angle between axis and plane
  const double nd = plane.direction.dot(axis.direction);
  at = axis.point + plane.direction.dot(plane.point - axis.point) / nd * axis.direction;
  return std::abs(nd) > kParallel;
}

PointAndDirection plane_of_four(const std::array<Vector3, 4>& p, const Vector3& up) {
  const Vector3 centroid = 0.25 * (p[0] + p[1] + p[2] + p[3]);
  Matrix3 S = Matrix3::Zero();
  for (const Vector3& point : p) {
    const Vector3 c = point - centroid;
    S += c * c.transpose();
  }
  return {centroid, normal_of_scatter(S, up)};
}

}  // namespace

Vector3 normal_of_scatter(const Matrix3& S, const Vector3& near) {
  constexpr int kSteps = 4;
  Vector3 n = near.normalized();
  for (int step = 0; step < kSteps; ++step) {
    const Vector3 e1 = n.unitOrthogonal(), e2 = n.cross(e1);
    const Vector3 S1 = S * e1, S2 = S * e2;
    const double a = e1.dot(S1), b = e1.dot(S2), c = e2.dot(S2), p = n.dot(S1), q = n.dot(S2);
    const double determinant = a * c - b * b;
    n = (n - (p * c - q * b) / determinant * e1 - (a * q - b * p) / determinant * e2).normalized();
  }
  return n;
}

Result<BarPoints> bar_points(std::span<const PointAndDirection> holes,
                             std::span<const PointAndDirection> rods,
                             std::span<const PointAndDirection> planes, const Vector3& up) {
  const auto parallel = [](const std::string& feature) {
    return failure(ErrorCode::DegenerateGeometry,
                   feature + ": the axis is parallel to the plane that it has to meet");
  };
  std::vector<std::array<Vector3, 2>> ends(rods.size());
  for (std::size_t j = 0; j < rods.size(); ++j) {
    for (std::size_t side = 0; side < 2; ++side) {
      if (!meet(rods[j], planes[2 * j + side], ends[j][side])) {
        return parallel(rod_name(j));
      }
    }
  }

  const auto plane_between = [&](std::size_t j, std::size_t k) {
    return plane_of_four({ends[j][0], ends[j][1], ends[k][0], ends[k][1]}, up);
  };
  const PointAndDirection reference = plane_between(0, rods.size() - 1);
  BarPoints result;
  result.O_m.resize(holes.size());
  for (std::size_t i = 0; i < holes.size(); ++i) {
    const bool at_end = i == 0 || i + 1 == holes.size();
    if (!meet(holes[i], at_end ? reference : plane_between(i - 1, i), result.O_m[i])) {
      return parallel(hole_name(i));
    }
  }

  const Vector3 x = (result.O_m.back() - result.O_m.front()).normalized();
  result.pose.origin_m = result.O_m.front();
  result.pose.axes << x, reference.direction.cross(x), reference.direction;
  return result;
}

Result<BarPoints> bar_points(const BarFeatures& f, const Matrix3& axes) {
  std::vector<PointAndDirection> holes, rods, planes;
  for (const fit::Cylinder& hole : f.holes) {
    holes.push_back({hole.point, hole.direction});
  }
  for (const fit::Cylinder& rod : f.rods) {
    rods.push_back({rod.point, rod.direction});
  }
  for (const auto& pair : f.planes) {
    planes.push_back({pair[0].point, pair[0].normal});
    planes.push_back({pair[1].point, pair[1].normal});
  }
  return bar_points(holes, rods, planes, axes.col(2));
}

}  // namespace abbe::calib::mfb
