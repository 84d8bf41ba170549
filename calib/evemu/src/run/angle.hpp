#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::evemu {

/// Angle between the lines along a and b, 0 to 90 degrees: the sign of a face normal is ignored.
[[nodiscard]] inline double line_angle_rad(const Vector3& a, const Vector3& b) {
  const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
  return std::min(angle, std::numbers::pi - angle);
}

}  // namespace abbe::calib::evemu
