#include "abbe/calib/internal/direct/scatter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/direct/convention.hpp"

namespace abbe::calib::direct {
namespace {

/// Operator that removes by least squares what the convention removes: an offset, and for a
/// straightness also a slope.
Eigen::MatrixXd residual_operator(const Runs& runs, const std::optional<ErrorMotion>& motion) {
  const auto m = static_cast<Eigen::Index>(runs.positions_m.size());
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(m, m);
  if (!motion) {
    return one;
  }

  Eigen::MatrixXd N = Eigen::MatrixXd::Ones(m, static_cast<Eigen::Index>(conditions_of(*motion)));
  if (N.cols() > 1) {
    N.col(1) = Eigen::Map<const Eigen::VectorXd>(runs.positions_m.data(), m);
  }
  return one - N * (N.transpose() * N).ldlt().solve(N.transpose());
}

/// Number of independent values divided by the number of values, from the correlation of
/// neighbouring positions (autoregressive process of order 1).
double independent_share(double squares, double neighbours) {
  const double rho = squares > 0.0 ? std::clamp(neighbours / squares, 0.0, 1.0) : 0.0;
  return (1.0 - rho * rho) / (1.0 + rho * rho);
}

}  // namespace

Scatter scatter_of(const Runs& runs, const std::optional<ErrorMotion>& motion) {
  const std::size_t n = runs.values.size(), m = runs.positions_m.size();
  const std::size_t conditions = motion ? conditions_of(*motion) : 0;
  if (n < 2 || m <= conditions) {
    return {};
  }
  const Eigen::MatrixXd M = residual_operator(runs, motion);
  const Eigen::VectorXd mean = runs.mean();
  double squares = 0.0, neighbours = 0.0;
  for (const Eigen::VectorXd& run : runs.values) {
    const Eigen::VectorXd r = M * (run - mean);
    squares += r.squaredNorm();
    neighbours += r.head(r.size() - 1).dot(r.tail(r.size() - 1));
  }
  if (squares == 0.0) {
    return {};
  }

  const auto all = static_cast<double>((n - 1) * (m - conditions));
  const auto dof = static_cast<std::size_t>(all * independent_share(squares, neighbours));
  return {squares / all, std::max(n - 1, dof)};
}

Eigen::MatrixXd covariance_of_runs(const Runs& runs, const std::optional<ErrorMotion>& motion,
                                   const Scatter& scatter, const Eigen::MatrixXd& P) {
  const double n = static_cast<double>(runs.values.size());
  const Eigen::MatrixXd pooled = scatter.variance / n * P * P.transpose();
  const Eigen::VectorXd own =
      runs.covariance_of_mean(P * residual_operator(runs, motion)).diagonal();
  Eigen::VectorXd factor = Eigen::VectorXd::Ones(pooled.rows());
  for (Eigen::Index i = 0; i < factor.size(); ++i) {
    if (own(i) > pooled(i, i) && pooled(i, i) > 0.0) {
      factor(i) = std::sqrt(own(i) / pooled(i, i));
    }
  }
  return factor.asDiagonal() * pooled * factor.asDiagonal();
}

bool uncertainty_known(const std::optional<ErrorMotion>& motion, const Scatter& scatter,
                       const DeviceUncertainty& device) {
  const bool is_angle = !motion || is_rotation(motion->motion);
  return scatter.dof > 0 || (is_angle ? device.u_rad : device.u_m) > 0.0;
}

}  // namespace abbe::calib::direct
