/// Gains of added columns, compared with ratios of the densities of the normal distribution.
#include "abbe/calib/internal/evemu/run/screen.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

namespace {
using abbe::calib::evemu::Screen;

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); });
}

/// log N(y; 0, K) without its constant.
double log_density(const Eigen::VectorXd& y, const Eigen::MatrixXd& K) {
  const Eigen::LLT<Eigen::MatrixXd> llt(K);
  double log_det = 0.0;
  for (Eigen::Index i = 0; i < K.rows(); ++i) log_det += 2.0 * std::log(llt.matrixLLT()(i, i));
  return -0.5 * (y.dot(llt.solve(y)) + log_det);
}

TEST(EvemuScreen, GivesTheRatioOfTheDensities) {
  std::mt19937 random(5);
  constexpr double kS_m = 2e-6;
  const Eigen::Index n = 36;
  const Eigen::MatrixXd X = random_matrix(n, 6, random), S = random_matrix(n, 3, random);
  const Eigen::MatrixXd A = 1e-6 * random_matrix(n, 2, random);
  const Eigen::VectorXd prior = 1e-10 * random_matrix(9, 1, random).cwiseAbs2();
  const Eigen::VectorXd y = 2e-5 * random_matrix(n, 1, random);
  Eigen::MatrixXd K = kS_m * kS_m * Eigen::MatrixXd::Identity(n, n) + A * A.transpose();
  K += X * prior.head(6).asDiagonal() * X.transpose() +
       S * prior.tail(3).asDiagonal() * S.transpose();
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(n, 3);
  C.middleRows(6, 12) = random_matrix(12, 3, random);  // of one position

  double best = -INFINITY, best_size_m = 0.0;
  for (const double size_m : Screen::kSizes_m) {
    const double gain = log_density(y, K + size_m * size_m * C * C.transpose()) - log_density(y, K);
    if (gain > best) best = gain, best_size_m = size_m;
  }
  const Screen::Gain gain = Screen(X, S, A, y, prior, kS_m).gain(C);
  EXPECT_NEAR(gain.log_likelihood, best, 1e-8 * std::abs(best));
  EXPECT_EQ(gain.size_m, best_size_m);
}

TEST(EvemuScreen, HasNoLikelihoodForColumnsThatAreNoNumbers) {
  const Eigen::MatrixXd one = Eigen::MatrixXd::Ones(4, 1);
  const Screen screen(one, one, one, one, Eigen::Vector2d(1.0, 1.0), 1.0);
  EXPECT_TRUE(std::isnan(screen.gain(NAN * one).log_likelihood));
}

}  // namespace
