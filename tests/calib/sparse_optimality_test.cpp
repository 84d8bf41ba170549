#include "abbe/calib/internal/sparse/optimality.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "sparse_problem.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::sparse;
using namespace abbe::tests::sparse;

TEST(SparseOptimality, ANudgedSolutionViolatesTheConditions) {
  const Eigen::MatrixXd X = orthogonal_design();
  const Eigen::VectorXd y = random_problem(16, 1, 31).y;
  const Penalty lasso{PenaltyKind::Lasso};
  const auto path = fit_path(X, y, lasso).value();
  Eigen::VectorXd b = path.standardised.col(50);
  EXPECT_LE(*kkt_violation(X, y, lasso, path.lambda[50], b), 1e-13);
  b(2) += 0.01;  // orthogonal columns: the gradient changes by the same amount
  EXPECT_NEAR(*kkt_violation(X, y, lasso, path.lambda[50], b), 0.01, 1e-12);
}

TEST(SparseOptimality, SolutionsOfTheLassoAreBelowTheirNeighbours) {
  const Problem problem = random_problem(40, 8, 32);
  const Penalty lasso{PenaltyKind::Lasso};
  const auto path =
      fit_path(problem.X, problem.y, lasso, {.lambda = {}, .tolerance = 1e-10}).value();
  const Eigen::VectorXd b = path.standardised.col(40);
  const double least = *objective(problem.X, problem.y, lasso, path.lambda[40], b);

  for (Eigen::Index j = 0; j < b.size(); ++j) {
    for (const double step : {-0.01, 0.01}) {
      Eigen::VectorXd other = b;
      other(j) += step;
      EXPECT_LT(least, *objective(problem.X, problem.y, lasso, path.lambda[40], other));
    }
  }
}

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

TEST(SparseOptimality, RefusesCoefficientsOfAnotherDesign) {
  const Problem problem = random_problem(30, 5, 36);
  EXPECT_EQ(kkt_violation(problem.X, problem.y, {}, 0.1, Eigen::VectorXd::Zero(4)).error().code,
            ErrorCode::BadInput);
  const auto path = fit_path(problem.X, problem.y, {}).value();
  EXPECT_EQ(convexity(problem.X.leftCols(3), path).error().code, ErrorCode::BadInput);
}

}  // namespace
