#include "observe/touch_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"

namespace abbe::calib::evemu {
namespace {

/// A fitted surface: its residuals, and the distance of a point from it.
struct Surface {
  double rms_m = 0.0;
  double largest_m = 0.0;  ///< largest absolute residual
  std::function<double(const Vector3&)> distance_m;
};
using FitSurface = std::function<std::optional<Surface>(std::span<const Vector3>)>;

std::optional<Surface> sphere_through(std::span<const Vector3> points) {
  const auto s = fit::fit_sphere(points);
  if (!s) {
    return std::nullopt;
  }
  return Surface{
      s->residuals.rms, std::max(-s->residuals.min, s->residuals.max),
      [c = s->centre, r = s->radius](const Vector3& p) { return std::abs((p - c).norm() - r); }};
}

std::optional<Surface> plane_through(std::span<const Vector3> points) {
  // fit_plane() needs a direction that is not parallel to the plane, to choose the side of the
  // normal; the side has no effect here. At least one of the three axes is such a direction.
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    if (const auto s = fit::fit_plane(points, Vector3(Vector3::Unit(axis)))) {
      return Surface{
          s->residuals.rms, std::max(-s->residuals.min, s->residuals.max),
          [at = s->point, n = s->normal](const Vector3& p) { return std::abs(n.dot(p - at)); }};
    }
  }
  return std::nullopt;
}

std::optional<std::string> wrong_touch(std::span<const Vector3> points, std::size_t unknowns,
                                       double most_off_m, const FitSurface& fit) {
  constexpr double kShare = 0.25;  // least ratio of a false touch's residual to its true distance
  constexpr double kClear = 10.0;  // least ratio of that distance to the rms of the other touches

  // Machine errors of some mm deform a sphere by 0.4 mm. If there are few touches, all but one of
  // them may fit another sphere by chance, although no touch is false.
  constexpr std::size_t kPerUnknown = 4;
  const std::optional<Surface> all = fit(points);
  if (!all || all->largest_m < kShare * most_off_m || points.size() < kPerUnknown * unknowns) {
    return std::nullopt;
  }

  std::size_t worst = 0;
  double worst_m = 0.0, rest_m = 0.0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    std::vector<Vector3> others(points.begin(), points.end());
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const std::optional<Surface> rest = fit(others);
    if (rest && (worst_m == 0.0 || rest->rms_m < rest_m)) {
      worst = k;
      worst_m = rest->distance_m(points[k]);
      rest_m = rest->rms_m;
    }
  }

  if (!(worst_m > most_off_m && worst_m > kClear * rest_m)) {
    return std::nullopt;
  }

  return message("touch ", worst + 1, " of ", points.size(), " lies ", worst_m * kMmPerM,
                 " mm off the surface of the others: a false trigger, or dirt; touch there again");
}

std::optional<std::string> rough_surface(const std::optional<Surface>& all, double most_off_m) {
  if (!all || all->largest_m <= most_off_m) {
    return std::nullopt;
  }
  return message("its touches lie up to ", all->largest_m * kMmPerM,
                 " mm off one surface: false triggers, or touches of another feature");
}

}  // namespace

std::optional<std::string> wrong_touch_on_ball(std::span<const Vector3> points_m,
                                               const ObserveOptions& options) {
  constexpr std::size_t kUnknowns = 4;
  auto one = wrong_touch(points_m, kUnknowns, options.least_false_touch_m, sphere_through);
  return one ? one : rough_surface(sphere_through(points_m), options.max_off_surface_m);
}

std::optional<std::string> wrong_touch_on_face(std::span<const Vector3> points_m,
                                               const ObserveOptions& options) {
  constexpr std::size_t kUnknowns = 3;
  auto one = wrong_touch(points_m, kUnknowns, options.least_false_touch_m, plane_through);
  return one ? one : rough_surface(plane_through(points_m), options.max_off_surface_m);
}

bool touched_from_below(const TouchedArtefact& seen) {
  Vector3 mean = Vector3::Zero();
  for (std::size_t b = 0; b < seen.balls.size(); ++b) {
    for (const Vector3& p : seen.ball_points_m[b]) {
      mean += (p - seen.balls[b].centre).normalized() /
              static_cast<double>(seen.ball_points_m[b].size());
    }
  }
  // Mean component along z of the directions from ball centre to touch: 0 for touches all around a
  // ball, about 0.5 for touches on its upper half.
  constexpr double kClearly = 0.2;
  return mean.dot(seen.T_self_uni.R.col(2)) < -kClearly * static_cast<double>(seen.balls.size());
}

}  // namespace abbe::calib::evemu
