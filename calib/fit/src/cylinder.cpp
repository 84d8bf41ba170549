#include "abbe/calib/fit/cylinder.hpp"

#include <cmath>
#include <numbers>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"
#include "radial_fit.hpp"

namespace abbe::calib::fit {
namespace {

constexpr std::size_t kUnknownsOfCylinder = 5;  // the unknowns alpha, beta, u, v, w of cylinder.hpp
/// Condition of the Jacobian above which rounding decides the result.
constexpr double kUndetermined = 1e10;

/// A cylinder and the axes x, y, z of its frame: origin on the axis, z along it. Lengths relative
/// to the centroid of the points, in units of their size.
struct Frame {
  Vector3 origin = Vector3::Zero();
  Matrix3 axes = Matrix3::Identity();
  double radius = 1.0;

  void turn_to(const Vector3& direction) {
    const Vector3 z = direction.normalized();
    const Vector3 x = z.unitOrthogonal();
    axes << x, z.cross(x), z;
  }
};

/// Start of the iteration for an axis along `direction`: algebraic circle fit to the points
/// projected along `direction`.
Frame start(const Eigen::Matrix3Xd& p, const Vector3& direction) {
  Frame f;
  f.turn_to(direction);
  const Radial<2> circle = algebraic<2>((f.axes.transpose() * p).topRows<2>());
  f.origin = f.axes.leftCols<2>() * circle.centre;
  f.radius = circle.radius;
  return f;
}

Linearised<5> linearised(const Eigen::Matrix3Xd& p, const Frame& f) {
  Linearised<5> at;
  at.J.resize(p.cols(), 5);
  at.r.resize(p.cols());
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    const Vector3 q = f.axes.transpose() * (p.col(i) - f.origin);
    const double distance = q.head<2>().norm();
    const double c = q.x() / distance, s = q.y() / distance, z = q.z();
    at.r(i) = distance - f.radius;
    at.J.row(i) << z * s, -z * c, -c, -s, -1.0;
  }
  return at;
}

/// Applies the change to the frame, then shifts the origin along the axis to the projection of the
/// centroid. Returns the size of the radius.
double move(Frame& f, const Eigen::Matrix<double, 5, 1>& change) {
  const Vector3 z = f.axes.col(2) + change(1) * f.axes.col(0) - change(0) * f.axes.col(1);
  f.origin += f.axes.leftCols<2>() * change.segment<2>(2);
  f.radius += change(4);
  f.turn_to(z);
  f.origin -= f.origin.dot(f.axes.col(2)) * f.axes.col(2);
  return std::abs(f.radius);
}

/// Start directions: a Fibonacci lattice on the hemisphere, then the principal directions of the
/// points.
std::vector<Vector3> starting_directions(const Matrix3& principal) {
  constexpr int kDirections = 24;
  std::vector<Vector3> all;
  for (int i = 0; i < kDirections; ++i) {
    const double z = (i + 0.5) / kDirections, xy = std::sqrt(1.0 - z * z);
    const SinCos angle = sin_cos(i * std::numbers::pi * (3.0 - std::sqrt(5.0)));
    all.emplace_back(xy * angle.cos, xy * angle.sin, z);
  }
  for (Eigen::Index k = 0; k < 3; ++k) {
    all.emplace_back(principal.col(k));
  }
  return all;
}

struct FoundCylinder {
  Frame frame;
  Iteration iteration;
  double squares = 0.0, condition = 0.0;  ///< sum of squared residuals and condition at the end of
                                          ///< the iteration

  [[nodiscard]] bool is_cylinder() const {
    return iteration.converged && frame.radius > 0.0 && condition < kUndetermined;
  }
};

FoundCylinder find_from(const Eigen::Matrix3Xd& p, const Vector3& direction) {
  FoundCylinder found{start(p, direction)};
  Frame& f = found.frame;
  found.iteration =
      minimise([&] { return linearised(p, f); },
               [&](const Eigen::Matrix<double, 5, 1>& change) { return move(f, change); });
  const Linearised<5> at = linearised(p, f);
  found.squares = at.r.squaredNorm();
  found.condition = cofactor<5>(at.J).condition;
  return found;
}

FoundCylinder find(const PointSet& set, const Eigen::Matrix3Xd& p,
                   const std::optional<Vector3>& near) {
  if (near) {
    return find_from(p, *near);
  }
  FoundCylinder best = find_from(p, set.directions.col(0));
  for (const Vector3& direction : starting_directions(set.directions)) {
    const FoundCylinder other = find_from(p, direction);
    if (other.is_cylinder() && (!best.is_cylinder() || other.squares < best.squares)) {
      best = other;
    }
  }
  return best;
}

/// Derivatives of point, direction and radius with respect to alpha, beta, u, v, w.
Eigen::Matrix<double, 7, 5> derivatives(const Frame& f, double size) {
  Eigen::Matrix<double, 7, 5> D = Eigen::Matrix<double, 7, 5>::Zero();
  D.block<3, 2>(0, 2) = size * f.axes.leftCols<2>();
  D.block<3, 1>(3, 0) = -f.axes.col(1);
  D.block<3, 1>(3, 1) = f.axes.col(0);
  D(6, 4) = size;
  return D;
}

double sign_of_direction(const Vector3& z, const std::optional<Vector3>& near) {
  Eigen::Index largest = 0;
  z.cwiseAbs().maxCoeff(&largest);
  return (near ? z.dot(*near) : z(largest)) < 0.0 ? -1.0 : 1.0;
}

}  // namespace

Result<Cylinder> fit_cylinder(std::span<const Vector3> points, std::optional<Vector3> near,
                              std::optional<double> known_sigma) {
  const Result<PointSet> set = point_set(points, kUnknownsOfCylinder, "cylinder");
  ABBE_TRY(set);
  if (set->in_a_plane()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("cylinder: the ", points.size(), " points lie ",
                           set->on_a_line() ? "on a line" : "in a plane", " (extents ",
                           set->singular_values.transpose(), ")"));
  }
  if (near && !(near->allFinite() && near->norm() > 0.0)) {
    return failure(
        near->allFinite() ? ErrorCode::BadInput : ErrorCode::NotFinite,
        message("cylinder: the approximate direction of the axis is ", near->transpose()));
  }

  const Eigen::Matrix3Xd p = set->centred / set->size;
  const FoundCylinder found = find(*set, p, near);
  const Frame& f = found.frame;
  const Linearised<5> at = linearised(p, f);
  const Cofactor<5> of = cofactor<5>(at.J);
  if (at.J.allFinite() && !(of.condition < kUndetermined)) {
    return failure(
        ErrorCode::DegenerateGeometry,
        message("cylinder: the ", points.size(), " points do not determine it (condition ",
                of.condition, "): touch it at more places around the axis"));
  }
  if (!found.is_cylinder()) {
    return failure(ErrorCode::NotConverged,
                   message("cylinder: ", points.size(), " points do not determine it (last step ",
                           found.iteration.step, " of the set's size after ", found.iteration.count,
                           " iterations)"));
  }

  Cylinder c;
  const double sign = sign_of_direction(f.axes.col(2), near);
  c.point = set->centroid + set->size * f.origin;
  c.direction = sign * f.axes.col(2);
  c.radius = set->size * f.radius;
  c.residuals = residual_statistics(set->size * at.r, kUnknownsOfCylinder);
  c.condition = of.condition;
  c.iterations = found.iteration.count;
  const double sigma = known_sigma.value_or(c.residuals.sigma0) / set->size;
  Eigen::Matrix<double, 7, 5> D = derivatives(f, set->size);
  D.middleRows<3>(3) *= sign;
  const Eigen::Matrix<double, 7, 5> root = sigma * D * of.root;
  c.covariance = root * root.transpose();

  return c;
}

Eigen::Matrix<double, 7, Eigen::Dynamic> derivatives_by_points(const Cylinder& c,
                                                               std::span<const Vector3> points) {
  Eigen::Matrix3Xd p(3, std::ssize(points));
  for (std::size_t i = 0; i < points.size(); ++i) {
    p.col(static_cast<Eigen::Index>(i)) = points[i] - c.point;
  }
  const double size = p.colwise().norm().maxCoeff();
  p /= size;

  Frame f;
  f.turn_to(c.direction);
  f.radius = c.radius / size;
  const Linearised<5> at = linearised(p, f);
  const Eigen::Matrix<double, 5, 5> root = cofactor<5>(at.J).root;
  return -derivatives(f, size) * root * root.transpose() * at.J.transpose() / size;
}

}  // namespace abbe::calib::fit
