#include "abbe/calib/internal/sparse/convexity.hpp"

#include <gtest/gtest.h>

#include "sparse_problem.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::sparse;
using namespace abbe::tests::sparse;

TEST(SparseConvexity, OfOrthogonalColumnsIsWhatThePenaltyLeaves) {
  const Eigen::MatrixXd X = orthogonal_design();
  const Eigen::VectorXd y = random_problem(16, 1, 33).y;
  const auto path = fit_path(X, y, {PenaltyKind::Scad, 3.0}).value();
  const auto diagnosis = convexity(X, path).value();
  EXPECT_NEAR(diagnosis.smallest_eigenvalue(99), 1.0 - 1.0 / 2.0, 1e-12);
  EXPECT_FALSE(diagnosis.first_nonconvex);
}

TEST(SparseConvexity, IsLostWhenTwoNearlyEqualColumnsAreIn) {
  Problem problem = random_problem(40, 6, 34);
  problem.X.col(1) = problem.X.col(0) + 0.05 * problem.X.col(1) / 10.0;
  problem.y += problem.X.col(1);
  const auto path =
      fit_path(problem.X, problem.y, {PenaltyKind::Mcp, 3.0}, {.lambda = {}, .max_sweeps = 1000000})
          .value();
  const auto diagnosis = convexity(problem.X, path).value();
  ASSERT_TRUE(diagnosis.first_nonconvex);
  const Eigen::Index k = *diagnosis.first_nonconvex;
  EXPECT_LT(diagnosis.smallest_eigenvalue(k), 0.0);
  EXPECT_TRUE((diagnosis.smallest_eigenvalue.head(k).array() >= 0.0).all());
}

TEST(SparseConvexity, OfTheLassoIsNeverLost) {
  const Problem problem = random_problem(30, 20, 35);
  const auto path = fit_path(problem.X, problem.y, {PenaltyKind::Lasso}).value();
  EXPECT_FALSE(convexity(problem.X, path)->first_nonconvex);
}

TEST(SparseConvexity, RefusesThePathOfAnotherDesign) {
  const Problem problem = random_problem(30, 5, 36);
  const auto path = fit_path(problem.X, problem.y, {}).value();
  EXPECT_EQ(convexity(problem.X.leftCols(3), path).error().code, ErrorCode::BadInput);
}

}  // namespace
