#include "abbe/calib/evemu/solve/linear_gaussian.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>

namespace {
using abbe::calib::evemu::LinearGaussian;

struct SmallProblem {
  Eigen::MatrixXd X, S;
  Eigen::VectorXd y, prior;
};
SmallProblem small_problem() {
  std::srand(4);
  SmallProblem p{Eigen::MatrixXd::Random(20, 4),
                 Eigen::MatrixXd::Random(20, 3),
                 Eigen::VectorXd::Random(20),
                 {}};
  p.prior = Eigen::VectorXd::Random(7).cwiseAbs() * 3;
  return p;
}

TEST(LinearGaussian, HasTheEvidenceOfTheFullCovariance) {
  const SmallProblem p = small_problem();
  const double noise = 0.3;
  Eigen::MatrixXd Z(20, 7);
  Z << p.X, p.S;
  const Eigen::MatrixXd K =
      Z * p.prior.asDiagonal() * Z.transpose() + noise * Eigen::MatrixXd::Identity(20, 20);
  const double expected = -0.5 * (std::log(K.determinant()) + p.y.dot(K.ldlt().solve(p.y)) +
                                  20 * std::log(2 * std::numbers::pi));
  EXPECT_NEAR(LinearGaussian(p.X, p.S, p.y).evidence(p.prior, noise).log_likelihood, expected,
              1e-10);
}

TEST(LinearGaussian, HasTheGradientOfItsEvidence) {
  const SmallProblem p = small_problem();
  const LinearGaussian problem(p.X, p.S, p.y);
  const double noise = 0.3, h = 1e-5;
  const auto e = problem.evidence(p.prior, noise);

  for (Eigen::Index j = 0; j < 7; ++j) {
    Eigen::VectorXd up = p.prior, down = p.prior;
    up(j) *= std::exp(h);
    down(j) *= std::exp(-h);
    const double numeric = (problem.evidence(up, noise).log_likelihood -
                            problem.evidence(down, noise).log_likelihood) /
                           (2 * h);
    EXPECT_NEAR(e.by_log_prior(j), numeric, 1e-7) << j;
  }

  const double numeric = (problem.evidence(p.prior, noise * std::exp(h)).log_likelihood -
                          problem.evidence(p.prior, noise * std::exp(-h)).log_likelihood) /
                         (2 * h);
  EXPECT_NEAR(e.by_log_noise, numeric, 1e-7);
}

/// One prior far above the others and noise below rounding: the covariance of y is singular.
TEST(LinearGaussian, HasNoLikelihoodWhereRoundingLeavesNoCovariance) {
  SmallProblem p = small_problem();
  p.prior.setConstant(1.0);
  p.prior(6) = 1e30;
  const auto e = LinearGaussian(p.X, p.S, p.y).evidence(p.prior, 1e-40);
  EXPECT_EQ(e.log_likelihood, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(e.by_log_prior, Eigen::VectorXd::Zero(7));
  const auto posterior = LinearGaussian(p.X, p.S, p.y).posterior(p.prior, 0.0);
  EXPECT_FALSE(posterior.mean.allFinite());
}

TEST(LinearGaussian, HasThePosteriorOfTheFullCovariance) {
  const SmallProblem p = small_problem();
  const double noise = 0.3;
  Eigen::MatrixXd Z(20, 7);
  Z << p.X, p.S;
  const Eigen::MatrixXd V = p.prior.asDiagonal();
  const Eigen::MatrixXd K = Z * V * Z.transpose() + noise * Eigen::MatrixXd::Identity(20, 20);
  const auto posterior = LinearGaussian(p.X, p.S, p.y).posterior(p.prior, noise);
  EXPECT_LT((posterior.mean - V * Z.transpose() * K.ldlt().solve(p.y)).norm(), 1e-12);
  EXPECT_LT((posterior.covariance - (V - V * Z.transpose() * K.ldlt().solve(Z * V))).norm(), 1e-12);
  const double hat = (p.X * V.topLeftCorner(4, 4) * p.X.transpose() * K.inverse()).trace();
  EXPECT_NEAR(posterior.effective_parameters, hat, 1e-10);
}

TEST(LinearGaussian, StatesWhatAQuantityInTheObservationsDoesToThePosterior) {
  const SmallProblem p = small_problem();
  const double noise = 0.3;
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(20, 2);
  const Eigen::VectorXd a = Eigen::VectorXd::Random(2);
  const LinearGaussian problem(p.X, p.S, A, p.y);
  const auto before = problem.posterior(p.prior, noise),
             after = LinearGaussian(p.X, p.S, p.y + A * a).posterior(p.prior, noise);
  EXPECT_LT((problem.response(p.prior, noise) * a - (after.mean - before.mean)).norm(), 1e-13);
  EXPECT_LT((LinearGaussian(p.X, p.S, p.y).posterior(p.prior, noise).mean - before.mean).norm(),
            1e-13);
  EXPECT_NEAR(problem.evidence(p.prior, noise).log_likelihood,
              LinearGaussian(p.X, p.S, p.y).evidence(p.prior, noise).log_likelihood, 1e-12);
}

}  // namespace
