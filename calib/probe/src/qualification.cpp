#include "abbe/calib/probe/qualification.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/singular_values.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::probe {
namespace {

constexpr int kUnknowns = 3 + LobingMap::kTerms;
constexpr std::size_t kLeastTouches = 24;  // 1.5 times the number of unknowns
constexpr int kMostIterations = 20;
constexpr double kStep_m = 1e-13;  // converged below this step, which is far below any measurement

using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;

Result<void> check(std::span<const QualifyingTouch> touches) {
  if (touches.size() < kLeastTouches) {
    return failure(ErrorCode::TooFewObservations,
                   message("probe qualification: ", touches.size(), " touches, at least ",
                           kLeastTouches, " are needed"));
  }
  for (const QualifyingTouch& t : touches) {
    if (!t.p_m.allFinite() || !t.normal.allFinite())
      return failure(ErrorCode::NotFinite, "probe qualification: a touch is not finite");
    if (!(t.normal.norm() > 1e-9))
      return failure(ErrorCode::BadInput, "probe qualification: a normal has zero length");
  }
  return {};
}

struct System {
  Eigen::MatrixXd J;  ///< negative Jacobian of the residuals by centre and terms
  Eigen::VectorXd r;  ///< measured minus model, m
};

System system_at(std::span<const QualifyingTouch> touches, const Unknowns& x,
                 double sphere_radius_m) {
  const auto n = static_cast<Eigen::Index>(touches.size());
  System s{Eigen::MatrixXd(n, kUnknowns), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vector3 d = touches[static_cast<std::size_t>(i)].p_m - x.head<3>();
    const Vector3 unit = d.normalized();
    const LobingMap::Terms Y = LobingMap::basis(unit);
    s.r[i] = d.norm() - sphere_radius_m - Y.dot(x.tail<LobingMap::kTerms>());
    // A change of the centre also changes the direction `unit`, and so the lobing. The Jacobian
    // neglects this effect, which is lobing divided by the radius, 1e-4 of `unit`; Gauss-Newton
    // converges without it.
    s.J.row(i).head<3>() = unit.transpose();
    s.J.row(i).tail<LobingMap::kTerms>() = Y.transpose();
  }

  return s;
}

double condition_of(const Eigen::MatrixXd& J) {
  const Eigen::RowVectorXd norms = J.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = J * norms.cwiseInverse().asDiagonal();
  const Eigen::VectorXd values = singular_values(scaled);
  return values[0] / std::max(values[values.size() - 1], 1e-300);
}

Vector3 first_centre(std::span<const QualifyingTouch> touches, double sphere_radius_m) {
  Vector3 sum = Vector3::Zero();
  for (const QualifyingTouch& t : touches) sum += t.p_m - sphere_radius_m * t.normal.normalized();
  return sum / static_cast<double>(touches.size());
}

double lobing_over(std::span<const QualifyingTouch> touches, const LobingMap& map) {
  double low = map.at(touches[0].normal).radius_m;
  double high = low;
  for (const QualifyingTouch& t : touches) {
    low = std::min(low, map.at(t.normal).radius_m);
    high = std::max(high, map.at(t.normal).radius_m);
  }
  return high - low;
}

}  // namespace

LobingMap::Terms LobingMap::basis(const Vector3& unit) {
  const double x = unit[0];
  const double y = unit[1];
  const double z = unit[2];
  Terms Y;
  Y << 1.0, x * y, y * z, x * z, x * x - y * y, 3.0 * z * z - 1.0,  //
      x * (x * x - 3.0 * y * y), y * (3.0 * x * x - y * y), z * (x * x - y * y), x * y * z,
      x * (5.0 * z * z - 1.0), y * (5.0 * z * z - 1.0), z * (5.0 * z * z - 3.0);
  return Y;
}

EffectiveRadius LobingMap::at(const Vector3& normal) const {
  const Terms Y = basis(normal.normalized());
  return {Y.dot(terms_m_), std::sqrt(std::max(0.0, Y.dot(covariance_m2_ * Y)))};
}

Result<Qualification> qualify(std::span<const QualifyingTouch> touches,
                              const QualificationOptions& options) {
  ABBE_TRY(check(touches));
  Unknowns x = Unknowns::Zero();
  x.head<3>() = first_centre(touches, options.sphere_radius_m);
  Qualification q;
  q.condition = condition_of(system_at(touches, x, options.sphere_radius_m).J);
  if (!(q.condition <= options.max_condition)) {
    return failure(
        ErrorCode::DegenerateGeometry,
        message("probe qualification: the touches cover too little of the sphere: condition ",
                q.condition, ", at most ", options.max_condition));
  }
  bool converged = false;
  for (int i = 0; i < kMostIterations && !converged; ++i) {
    const System s = system_at(touches, x, options.sphere_radius_m);
    const Unknowns step = s.J.colPivHouseholderQr().solve(s.r);
    // d(residual) = -J dx: the distance shrinks when the centre moves along n.
    x += step;
    converged = step.head<4>().lpNorm<Eigen::Infinity>() < kStep_m;
  }
  if (!converged || !x.allFinite())
    return failure(ErrorCode::NotConverged,
                   message("probe qualification: no convergence in ", kMostIterations, " steps"));

  const System s = system_at(touches, x, options.sphere_radius_m);
  q.freedom = static_cast<int>(touches.size()) - kUnknowns;
  q.residual_rms_m = std::sqrt(s.r.squaredNorm() / static_cast<double>(touches.size()));
  q.sigma_m = std::sqrt(s.r.squaredNorm() / q.freedom);
  const Eigen::Matrix<double, kUnknowns, kUnknowns> normal = s.J.transpose() * s.J;
  const Eigen::Matrix<double, kUnknowns, kUnknowns> covariance =
      q.sigma_m * q.sigma_m * normal.inverse();
  q.centre_m = x.head<3>();
  q.cov_centre_m2 = covariance.topLeftCorner<3, 3>();
  LobingMap::Covariance terms =
      covariance.bottomRightCorner<LobingMap::kTerms, LobingMap::kTerms>();
  // An error of the sphere radius causes an error of equal size and opposite sign of the effective
  // tip radius.
  terms(0, 0) += options.u_sphere_radius_m * options.u_sphere_radius_m;
  q.map = LobingMap{x.tail<LobingMap::kTerms>(), terms};
  q.lobing_m = lobing_over(touches, q.map);
  return q;
}

}  // namespace abbe::calib::probe
