#pragma once
/// Finds single points that do not fit the rigid motion of all other points: a row of a file that
/// holds 0, 0, 0 or -9999 for a point that was not measured, a wrong digit, a reflector that was
/// not seated.
///
/// The points with the largest residuals are left out one by one, at most a fifth of all, and the
/// rigid motion is fitted to the rest. A point is reported if its distance d from the place that
/// this motion gives satisfies
///     d > 10 u sqrt(3 + tr(J N^-1 J^T)),   u^2 = SS / (3 n - 6)
/// SS: sum of squared residuals of the n points that fit; J: derivative of the point by the rigid
/// motion; N: normal matrix of the fit. The square root is the standard deviation of d relative to
/// u, and includes extrapolation. Reason for the factor 10: machine errors are not random, and the
/// largest of them is a few times their rms. For random errors F(3, 9), the distribution with the
/// fewest degrees of freedom that are tested, exceeds 10^2 with a probability below 1e-6 per point.
/// Not found are errors below this limit, any error among fewer than 6 points, and the case that
/// more than a fifth of the points are wrong. Lengths in m. Pure; allocates.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::fit {

struct PointOff {
  std::size_t point = 0;
  double distance_m = 0.0;  ///< distance d, see above
};

struct PointsOff {
  std::vector<PointOff> points;  ///< by ascending index
  double rms_others_m = 0.0;     ///< rms distance of all other points; 0 if no point is off
};

/// `measured_m[i]` is the measurement of the point `wanted_m[i]`, in another frame. A point with d
/// <= `least_m` is not reported.
[[nodiscard]] PointsOff points_off(std::span<const Vector3> measured_m,
                                   std::span<const Vector3> wanted_m, double least_m = 0.0);

}  // namespace abbe::calib::fit
