#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib::evemu {

/// Between the lines along a and b: a face may be met from either side.
[[nodiscard]] inline double line_angle_rad(const Vector3& a, const Vector3& b) {
  const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
  return std::min(angle, std::numbers::pi - angle);
}

}  // namespace abbe::calib::evemu
