#include "abbe/calib/internal/sparse/path.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "abbe/calib/internal/sparse/cross_validation.hpp"
#include "sparse_problem.hpp"
#include "sparse_solution.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::sparse;
using namespace abbe::tests::sparse;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::array kPenalties{Penalty{PenaltyKind::Lasso, 0}, Penalty{PenaltyKind::Mcp, 3.0},
                                Penalty{PenaltyKind::Scad, 3.7}};

PathOptions exact() {
  return {.lambda = {}, .tolerance = 1e-12, .max_sweeps = 1000000};
}

TEST(SparsePath, OrthogonalColumnsHaveClosedFormSolutions) {
  const Eigen::MatrixXd X = orthogonal_design();
  const Eigen::VectorXd y = random_problem(16, 1, 11).y * 3.0;
  const Eigen::VectorXd z = X.transpose() * y / 16.0;

  for (const Penalty& penalty : kPenalties) {
    const auto path = fit_path(X, y, penalty);
    ASSERT_TRUE(path) << path.error().text;
    for (Eigen::Index k = 0; k < path->reached(); ++k) {
      for (Eigen::Index j = 0; j < z.size(); ++j) {
        const double expected = minimiser(penalty, path->lambda[static_cast<std::size_t>(k)], z(j));
        ASSERT_NEAR(path->coefficients(1 + j, k), expected, 1e-13)
            << name(penalty.kind) << ' ' << k << ' ' << j;
      }
    }
  }
}

TEST(SparsePath, EverySolutionIsAStationaryPoint) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    const Problem problem = random_problem(60, 20, seed);
    for (const Penalty& penalty : kPenalties) {
      const auto path = fit_path(problem.X, problem.y, penalty, exact());
      ASSERT_TRUE(path) << path.error().text;
      ASSERT_EQ(path->reached(), 100);
      for (Eigen::Index k = 0; k < path->reached(); ++k) {
        const double lambda = path->lambda[static_cast<std::size_t>(k)];
        // a change of 1e-12 rms(y) in the last sweep leaves gradients of that size times the number
        // of columns
        ASSERT_LE(kkt_violation(problem.X, problem.y, penalty, lambda, path->standardised.col(k)),
                  1e-10)
            << name(penalty.kind) << " seed " << seed << " lambda " << lambda;
      }
    }
  }
}

TEST(SparsePath, ANudgedSolutionIsNotStationary) {
  const Eigen::MatrixXd X = orthogonal_design();
  const Eigen::VectorXd y = random_problem(16, 1, 31).y;
  const Penalty lasso{PenaltyKind::Lasso};
  const auto path = fit_path(X, y, lasso).value();
  Eigen::VectorXd b = path.standardised.col(50);
  EXPECT_LE(kkt_violation(X, y, lasso, path.lambda[50], b), 1e-13);
  b(2) += 0.01;  // orthogonal columns: the gradient changes by the same amount
  EXPECT_NEAR(kkt_violation(X, y, lasso, path.lambda[50], b), 0.01, 1e-12);
}

TEST(SparsePath, SolutionsOfTheLassoAreBelowTheirNeighbours) {
  const Problem problem = random_problem(40, 8, 32);
  const Penalty lasso{PenaltyKind::Lasso};
  const auto path =
      fit_path(problem.X, problem.y, lasso, {.lambda = {}, .tolerance = 1e-10}).value();
  const Eigen::VectorXd b = path.standardised.col(40);
  const double least = objective(problem.X, problem.y, lasso, path.lambda[40], b);

  for (Eigen::Index j = 0; j < b.size(); ++j) {
    for (const double step : {-0.01, 0.01}) {
      Eigen::VectorXd other = b;
      other(j) += step;
      EXPECT_LT(least, objective(problem.X, problem.y, lasso, path.lambda[40], other));
    }
  }
}

TEST(SparsePath, WithoutPenaltyIsLeastSquares) {
  const Problem problem = random_problem(60, 12, 6);
  PathOptions options = exact();
  options.lambda = {0.1, 0.0};
  const auto path = fit_path(problem.X, problem.y, {PenaltyKind::Scad, 3.7}, options);
  ASSERT_TRUE(path) << path.error().text;
  Eigen::MatrixXd A(60, 13);
  A << Eigen::VectorXd::Ones(60), problem.X;
  const Eigen::VectorXd fitted = A * A.colPivHouseholderQr().solve(problem.y);
  EXPECT_LE((predict(*path, problem.X, 1) - fitted).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(SparsePath, StartsAtTheSmallestLambdaWithAnEmptySolution) {
  const Problem problem = random_problem(60, 20, 7);
  const auto path = fit_path(problem.X, problem.y, {PenaltyKind::Lasso});
  ASSERT_TRUE(path);
  EXPECT_EQ(path->sweeps.front(), 0);
  EXPECT_TRUE(path->standardised.col(0).isZero(0));
  EXPECT_FALSE(path->standardised.col(1).isZero(0));
  EXPECT_DOUBLE_EQ(path->coefficients(0, 0), problem.y.mean());
}

TEST(SparsePath, DefaultLambdaFallsToATwentiethWithFewRows) {
  const Problem problem = random_problem(15, 20, 8);
  const auto path = fit_path(problem.X, problem.y, {PenaltyKind::Lasso});
  ASSERT_TRUE(path);
  EXPECT_EQ(path->lambda.size(), 100U);
  EXPECT_NEAR(path->lambda.back() / path->lambda.front(), 0.05, 1e-12);
}

TEST(SparsePath, DoesNotDependOnUnitsAndOriginsOfColumns) {
  const Problem problem = random_problem(60, 20, 9);
  Eigen::MatrixXd moved = problem.X * 0.25;
  moved.array() += 8.0;
  const auto path = fit_path(problem.X, problem.y, {PenaltyKind::Mcp, 3.0});
  const auto other = fit_path(moved, problem.y, {PenaltyKind::Mcp, 3.0}, {.lambda = path->lambda});
  ASSERT_TRUE(other);
  EXPECT_LE((predict(*path, problem.X, 60) - predict(*other, moved, 60)).cwiseAbs().maxCoeff(),
            1e-10);
}

TEST(SparsePath, ColumnsThatDoNotVaryAreDropped) {
  const Problem problem = random_problem(60, 8, 10);
  Eigen::MatrixXd with_constants(60, 10);
  with_constants << Eigen::VectorXd::Constant(60, 5.0), problem.X, Eigen::VectorXd::Zero(60);
  const auto path = fit_path(with_constants, problem.y, {});
  const auto without = fit_path(problem.X, problem.y, {});
  ASSERT_TRUE(path && without);
  EXPECT_THAT(path->dropped, ElementsAre(0, 9));
  EXPECT_TRUE(path->coefficients.row(1).isZero(0));
  EXPECT_EQ(path->standardised.middleRows(1, 8), without->standardised);
}

TEST(SparsePath, EndsWhereTheBudgetEnds) {
  const Problem problem = random_problem(60, 20, 12);
  const auto path = fit_path(problem.X, problem.y, {}, {.lambda = {}, .max_sweeps = 50});
  const auto whole = fit_path(problem.X, problem.y, {});
  ASSERT_TRUE(path && whole);
  EXPECT_EQ(std::accumulate(path->sweeps.begin(), path->sweeps.end(), 0L), 50);
  EXPECT_TRUE(path->budget_exhausted);
  EXPECT_LT(path->reached(), 100);
  const Eigen::Index converged = path->reached() - 1;
  EXPECT_EQ(path->coefficients.leftCols(converged), whole->coefficients.leftCols(converged));
}

TEST(SparsePath, EndsAfterTooManyCoefficients) {
  const Problem problem = random_problem(60, 20, 13);
  const auto path = fit_path(problem.X, problem.y, {}, {.lambda = {}, .max_nonzero = 3});
  ASSERT_TRUE(path);
  const auto nonzero = (path->standardised.array() != 0.0).colwise().count();
  EXPECT_GT(nonzero(path->reached() - 1), 3);
  EXPECT_LE(nonzero(path->reached() - 2), 3);
}

TEST(SparsePath, MoreColumnsThanRowsStillSolvesTheLasso) {
  const Problem problem = random_problem(30, 70, 14);
  const auto path = fit_path(problem.X, problem.y, {PenaltyKind::Lasso}, exact());
  ASSERT_TRUE(path);
  const Eigen::Index last = path->reached() - 1;
  EXPECT_LE(kkt_violation(problem.X, problem.y, path->penalty, path->lambda.back(),
                          path->standardised.col(last)),
            1e-10);
  EXPECT_LE((path->standardised.col(last).array() != 0.0).count(), 29);
}

struct BadCase {
  const char* name;
  Problem problem;
  Penalty penalty;
  PathOptions options;
  ErrorCode code;
  const char* text;

  friend void PrintTo(const BadCase& bad, std::ostream* out) { *out << bad.name; }
};

std::vector<BadCase> bad_cases() {
  const Problem good = random_problem(20, 4, 15);
  Problem nan_in_X = good, nan_in_y = good, short_y = good, one_row = good, flat_y = good,
          flat_X = good;
  nan_in_X.X(3, 2) = std::nan("");
  nan_in_y.y(3) = std::numeric_limits<double>::infinity();
  short_y.y.conservativeResize(19);
  one_row = {good.X.topRows(1), good.y.head(1)};
  flat_y.y.setConstant(0.1);
  flat_X.X.setConstant(7.0);
  Problem huge_X = good, huge_y = good;
  huge_X.X(0, 0) = 1e200;
  huge_y.y(0) = 1e200;
  using enum ErrorCode;

  return {{"NanInDesign", nan_in_X, {}, {}, NotFinite, "design"},
          {"InfinityInY", nan_in_y, {}, {}, NotFinite, "in y"},
          {"HugeDesign", huge_X, {}, {}, NotFinite, "too large"},
          {"HugeY", huge_y, {}, {}, NotFinite, "too large"},
          {"ShapesDiffer", short_y, {}, {}, BadInput, "20 rows in the design, 19 in y"},
          {"OneRow", one_row, {}, {}, TooFewObservations, "1 row"},
          {"ConstantY", flat_y, {}, {}, TooFewObservations, "does not vary"},
          {"ConstantColumns", flat_X, {}, {}, BadInput, "none of 4 columns varies"},
          {"ScadGamma", good, {PenaltyKind::Scad, 2.0}, {}, BadInput, "greater than 2"},
          {"McpGamma", good, {PenaltyKind::Mcp, 0.9}, {}, BadInput, "greater than 1"},
          {"LambdaIncreases", good, {}, {.lambda = {0.1, 0.2}}, BadInput, "must not increase"},
          {"LambdaNegative", good, {}, {.lambda = {0.1, -0.2}}, BadInput, "negative"},
          {"LambdaNan", good, {}, {.lambda = {std::nan("")}}, NotFinite, "lambda 0"},
          {"Tolerance", good, {}, {.lambda = {}, .tolerance = 0.0}, BadInput, "tolerance"},
          {"Budget", good, {}, {.lambda = {}, .max_sweeps = 0}, BadInput, "max_sweeps"}};
}

class SparsePathRefuses : public testing::TestWithParam<BadCase> {};
TEST_P(SparsePathRefuses, BadInputByName) {
  const BadCase& bad = GetParam();
  const auto path = fit_path(bad.problem.X, bad.problem.y, bad.penalty, bad.options);
  ASSERT_FALSE(path);
  EXPECT_EQ(path.error().code, bad.code);
  EXPECT_THAT(path.error().text, HasSubstr(bad.text));
}
INSTANTIATE_TEST_SUITE_P(Inputs, SparsePathRefuses, testing::ValuesIn(bad_cases()),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
