#include "abbe/calib/fit/sphere.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "abbe/calib/fit/point_set.hpp"
#include "message.hpp"

namespace abbe::calib::fit {
namespace {

constexpr std::size_t kUnknowns = 4;

/// Centre and radius in units of the size of the point set, relative to its centroid.
struct Normalised {
  Vector3 centre = Vector3::Zero();
  double radius = 1.0;
};

/// Algebraic fit: |p|^2 = 2 c . p + (r^2 - |c|^2) is linear in c and in the term in brackets.
Normalised algebraic(const Eigen::Matrix3Xd& p) {
  Eigen::MatrixX4d A(p.cols(), 4);
  A << 2.0 * p.transpose(), Eigen::VectorXd::Ones(p.cols());
  const Eigen::Vector4d x = A.colPivHouseholderQr().solve(p.colwise().squaredNorm().transpose());
  return {x.head<3>(), std::sqrt(std::max(0.0, x(3) + x.head<3>().squaredNorm()))};
}

/// Jacobian of the residuals |p_i - c| - radius with respect to centre c and radius; writes the
/// residuals to `r`.
Eigen::MatrixX4d jacobian(const Eigen::Matrix3Xd& p, const Normalised& s, Eigen::VectorXd& r) {
  Eigen::MatrixX4d J(p.cols(), 4);
  r.resize(p.cols());
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    const Vector3 away = p.col(i) - s.centre;
    const double distance = away.norm();
    r(i) = distance - s.radius;
    J.row(i) << -away.transpose() / distance, -1.0;
  }
  return J;
}

}  // namespace

Result<Sphere> fit_sphere(std::span<const Vector3> points, std::optional<double> known_sigma) {
  const Result<PointSet> set = point_set(points, kUnknowns, "sphere");
  if (!set) {
    return tl::unexpected(set.error());
  }

  if (set->in_a_plane()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("sphere: the ", points.size(), " points lie in a plane (extents ",
                           set->singular_values.transpose(), ")"));
  }

  const Eigen::Matrix3Xd p = set->centred / set->size;
  Normalised s = algebraic(p);
  Sphere sphere;
  Eigen::VectorXd r;

  // On points with noise of up to a fortieth of the radius, Gauss-Newton needs 2 to 13 steps until
  // only rounding errors remain.
  constexpr int kMostIterations = 100;
  constexpr double kSettled = 1e-15;
  double step = 1.0, before = 2.0;

  while (step > kSettled * (1.0 + s.radius) && sphere.iterations < kMostIterations) {
    const Eigen::MatrixX4d J = jacobian(p, s, r);
    const Eigen::Vector4d change = -J.colPivHouseholderQr().solve(r);
    s.centre += change.head<3>();
    s.radius += change(3);
    before = step;
    step = change.norm();
    ++sphere.iterations;
    constexpr double kRounding = 1e-11;
    if (step < kRounding * (1.0 + s.radius) && step >= 0.5 * before) {
      break;  // the step is rounding error
    }
  }

  if (!std::isfinite(step) || sphere.iterations >= kMostIterations || !(s.radius > 0.0)) {
    return failure(ErrorCode::NotConverged,
                   message("sphere: ", points.size(), " points do not determine it (last step ",
                           step, " of the set's size after ", sphere.iterations, " iterations)"));
  }

  const Eigen::HouseholderQR<Eigen::MatrixX4d> qr(jacobian(p, s, r));
  Eigen::Matrix4d R = qr.matrixQR().topRows<4>();
  R.triangularView<Eigen::StrictlyLower>().setZero();
  const Eigen::JacobiSVD<Eigen::Matrix4d, Eigen::NoQRPreconditioner> svd(R, Eigen::ComputeFullV);
  sphere.condition = svd.singularValues()(0) / svd.singularValues()(3);
  sphere.centre = set->centroid + set->size * s.centre;
  sphere.radius = set->size * s.radius;
  sphere.residuals = residual_statistics(set->size * r, kUnknowns);
  const Eigen::Matrix4d root = svd.matrixV() * svd.singularValues().cwiseInverse().asDiagonal();
  const double sigma = known_sigma.value_or(sphere.residuals.sigma0);
  sphere.covariance = sigma * sigma * root * root.transpose();

  return sphere;
}

}  // namespace abbe::calib::fit
