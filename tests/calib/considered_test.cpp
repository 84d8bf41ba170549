#include "abbe/calib/internal/estimation/considered.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace {
using namespace abbe::calib::estimation;

Eigen::MatrixXd normal_deviates(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); });
}

// An error of a quantity that the adjustment takes for zero: y contains B a, the estimate of U is
// made without it.
TEST(ConsideredUnknowns, ChangeTheEstimateByTheirSensitivity) {
  const Eigen::MatrixXd A = normal_deviates(30, 5, 1), B = normal_deviates(30, 2, 2);
  const Eigen::VectorXd y = normal_deviates(30, 1, 3), a = normal_deviates(2, 1, 4);
  Eigen::MatrixXd all(30, 7);
  all << A, B;
  Information information(7);
  information.add_rows(all, y);

  const Eigen::HouseholderQR<Eigen::MatrixXd> without(A);
  const Eigen::VectorXd change = without.solve(y + B * a) - without.solve(y);
  EXPECT_LT((sensitivity(information, 5) * a - change).norm(), 1e-13 * change.norm() * 30);
}

TEST(ConsideredUnknowns, MayBeNone) {
  Information information(3);
  information.add_rows(normal_deviates(10, 3, 1), normal_deviates(10, 1, 2));
  EXPECT_EQ(sensitivity(information, 3).cols(), 0);
}

}  // namespace
