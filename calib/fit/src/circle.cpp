#include "abbe/calib/internal/fit/circle.hpp"

#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"
#include "abbe/result/try.hpp"
#include "radial_fit.hpp"

namespace abbe::calib::fit {

Result<Circle> fit_circle(std::span<const Eigen::Vector2d> points,
                          std::optional<double> known_sigma) {
  constexpr std::size_t kUnknownsOfCircle = 3;
  std::vector<Vector3> in_space;
  for (const Eigen::Vector2d& p : points) {
    in_space.emplace_back(p.x(), p.y(), 0.0);
  }
  const Result<PointSet> set = point_set(in_space, kUnknownsOfCircle, "circle");
  ABBE_TRY(set);
  if (set->on_a_line()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("circle: the ", points.size(), " points lie on a line (extents ",
                           set->singular_values.head<2>().transpose(), ")"));
  }

  const Points<2> p = set->centred.topRows<2>() / set->size;
  Radial<2> c = algebraic<2>(p);
  const Iteration iteration = refine<2>(p, c);
  if (!iteration.converged || !(c.radius > 0.0)) {
    return failure(
        ErrorCode::NotConverged,
        message("circle: ", points.size(), " points do not determine it (last step ",
                iteration.step, " of the set's size after ", iteration.count, " iterations)"));
  }

  const Linearised<3> at = linearised<2>(p, c);
  const Cofactor<3> of = cofactor<3>(at.J);
  Circle circle;
  circle.centre = set->centroid.head<2>() + set->size * c.centre;
  circle.radius = set->size * c.radius;
  circle.residuals = residual_statistics(set->size * at.r, kUnknownsOfCircle);
  circle.condition = of.condition;
  circle.iterations = iteration.count;
  const double sigma = known_sigma.value_or(circle.residuals.sigma0);
  circle.covariance = sigma * sigma * of.root * of.root.transpose();

  return circle;
}

}  // namespace abbe::calib::fit
