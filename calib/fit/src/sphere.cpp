#include "abbe/calib/fit/sphere.hpp"

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"
#include "abbe/result/try.hpp"
#include "radial_fit.hpp"

namespace abbe::calib::fit {
namespace {

constexpr std::size_t kUnknowns = 4;

}  // namespace

Result<Sphere> fit_sphere(std::span<const Vector3> points, std::optional<double> known_sigma) {
  const Result<PointSet> set = point_set(points, kUnknowns, "sphere");
  ABBE_TRY(set);

  if (set->in_a_plane()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("sphere: the ", points.size(), " points lie in a plane (extents ",
                           set->singular_values.transpose(), ")"));
  }

  const Eigen::Matrix3Xd p = set->centred / set->size;
  Radial<3> s = algebraic<3>(p);
  const Iteration iteration = refine<3>(p, s);
  if (!iteration.converged || !(s.radius > 0.0)) {
    return failure(
        ErrorCode::NotConverged,
        message("sphere: ", points.size(), " points do not determine it (last step ",
                iteration.step, " of the set's size after ", iteration.count, " iterations)"));
  }

  Sphere sphere;
  const Linearised<4> at = linearised<3>(p, s);
  const Cofactor<4> of = cofactor<4>(at.J);
  sphere.iterations = iteration.count;
  sphere.condition = of.condition;
  sphere.centre = set->centroid + set->size * s.centre;
  sphere.radius = set->size * s.radius;
  sphere.residuals = residual_statistics(set->size * at.r, kUnknowns);
  const double sigma = known_sigma.value_or(sphere.residuals.sigma0);
  sphere.covariance = sigma * sigma * of.root * of.root.transpose();

  return sphere;
}

}  // namespace abbe::calib::fit
