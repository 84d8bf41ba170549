#include "abbe/calib/evemu/solve/noise.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "evemu_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;

/// Touches with slow noise: no two balls of a position have the same covariance.
Observations with_correlated_balls() {
  Observations o = *observe(touches_in_order(reference_touches("touched_noiseless.csv")),
                            reference_calibrator(), reference_machine());
  o.slow_noise = 2.0;
  return o;
}

/// C0 of all rows: ball_covariance() of every position for each of the three components.
Eigen::MatrixXd covariance_of_rows(const Observations& o) {
  const auto n = static_cast<Eigen::Index>(3 * o.rows.size());
  Eigen::MatrixXd C0 = Eigen::MatrixXd::Zero(n, n);
  for (const PositionRows& p : position_rows(o)) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      const auto at = Eigen::seqN(3 * static_cast<Eigen::Index>(p.first) + c,
                                  static_cast<Eigen::Index>(p.count), 3);
      C0(at, at) = ball_covariance(o, p);
    }
  }
  return C0;
}

TEST(EvemuNoise, HasRootsOfTheCovarianceOfAllRows) {
  const Observations o = with_correlated_balls();
  const Eigen::MatrixXd C0 = covariance_of_rows(o);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(C0.rows(), C0.cols());
  const Eigen::MatrixXd L = coloured(o, identity), white = whitened(o, identity);

  constexpr double kRounding = 1e-13;  // entries of C0 are up to 10
  EXPECT_LT((L * L.transpose() - C0).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_LT((times_noise_root(o, identity) - L.transpose()).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_LT((white * L - identity).cwiseAbs().maxCoeff(), kRounding);
}

}  // namespace
