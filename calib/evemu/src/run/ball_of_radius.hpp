#pragma once

#include <optional>
#include <span>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::evemu {

/// A sphere whose radius is known, for balls with few touches.
struct BallOfRadius {
  Vector3 centre_m = Vector3::Zero();
  double squares_m2 = 0.0;  ///< sum of squares of the residuals
};

/// Least-squares centre by Gauss-Newton from `start_m`. nullopt with fewer than 3 points, or if the
/// points do not determine a centre.
[[nodiscard]] std::optional<BallOfRadius> fit_ball_of_radius(std::span<const Vector3> points_m,
                                                             double radius_m,
                                                             const Vector3& start_m);

}  // namespace abbe::calib::evemu
