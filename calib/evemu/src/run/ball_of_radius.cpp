#include "run/ball_of_radius.hpp"

#include <Eigen/Dense>
#include <iterator>

namespace abbe::calib::evemu {

std::optional<BallOfRadius> fit_ball_of_radius(std::span<const Vector3> points_m, double radius_m,
                                               const Vector3& start_m) {
  constexpr int kIterations = 20;  // enough: convergence is quadratic from a start within some mm
  constexpr double kSettled = 1e-12;
  BallOfRadius ball{.centre_m = start_m};
  Eigen::MatrixX3d J(std::ssize(points_m), 3);
  Eigen::VectorXd r(std::ssize(points_m));

  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (Eigen::Index k = 0; k < r.size(); ++k) {
      const Vector3 from = points_m[static_cast<std::size_t>(k)] - ball.centre_m;
      J.row(k) = -from.normalized().transpose();
      r(k) = from.norm() - radius_m;
    }

    const Eigen::ColPivHouseholderQR<Eigen::MatrixX3d> qr(J);
    if (qr.rank() < 3 || !r.allFinite()) {
      return std::nullopt;
    }

    ball.squares_m2 = r.squaredNorm();
    const Vector3 change = qr.solve(r);
    ball.centre_m -= change;
    if (change.norm() < kSettled) {
      return ball;
    }
  }

  return std::nullopt;
}

}  // namespace abbe::calib::evemu
