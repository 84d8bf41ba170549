#pragma once
/// Single points that do not fit a rigid motion that all other points share: a row of a file that
/// holds 0, 0, 0 or -9999 for a point that was not measured, a wrong digit, a reflector that was
/// not seated.
///
/// The points with the largest residuals are left out one by one, at most a fifth of all, and the
/// rigid motion is fitted to the rest. A point is off if its distance d from where this motion
/// places it satisfies
///     d > 10 u sqrt(3 + tr(J N^-1 J^T)),   u^2 = SS / (3 n - 6)
/// SS: sum of squared residuals of the n points that fit; J: rigid motion to point, N: normal
/// matrix of the fit, so that the root is the standard deviation of d relative to u, extrapolation
/// included. 10: machine errors are not random, the largest of them is a few times their rms; for
/// random ones F(3, 9), the fewest degrees of freedom that are tested, exceeds 10^2 with a
/// probability below 1e-6 per point. Not found: more than a fifth of the points off, fewer than 6
/// points, and errors below this limit. Lengths in m. Pure; allocates.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::fit {

struct PointOff {
  std::size_t point = 0;
  double distance_m = 0.0;  ///< d
};

struct PointsOff {
  std::vector<PointOff> points;  ///< ascending
  double rms_others_m = 0.0;     ///< rms distance of all other points; 0 if no point is off
};

/// `measured_m[i]` is the measurement of the point `wanted_m[i]`, in a frame of its own. A point
/// with d <= `least_m` is not off.
[[nodiscard]] PointsOff points_off(std::span<const Vector3> measured_m,
                                   std::span<const Vector3> wanted_m, double least_m = 0.0);

}  // namespace abbe::calib::fit
