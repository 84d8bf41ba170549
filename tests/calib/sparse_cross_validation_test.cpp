#include "abbe/calib/internal/sparse/cross_validation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <thread>

#include "sparse_problem.hpp"
#include "sparse_solution.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::sparse;
using namespace abbe::tests::sparse;
using testing::HasSubstr;

/// NaN equals NaN.
bool same_bits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() &&
         ((a.array() == b.array()) || (a.array().isNaN() && b.array().isNaN())).all();
}

Folds five_folds(const Problem& problem) {
  return random_folds(static_cast<std::size_t>(problem.y.size()), 5, 42).value();
}

/// The grid of one gamma.
Result<GridSearch> search(const Problem& problem, const Penalty& penalty, const Folds& folds,
                          const PathOptions& options = {}) {
  return grid_search(problem.X, problem.y, penalty.kind, {penalty.gamma}, folds, options);
}

/// Mean squared error of held-out rows, from fits made one by one.
double error_by_hand(const Problem& problem, const Folds& folds, const Penalty& penalty,
                     const PathOptions& options, Eigen::Index k) {
  double sum = 0.0;
  for (int fold = 0; fold < folds.count; ++fold) {
    std::vector<Eigen::Index> in, out;
    for (std::size_t i = 0; i < folds.of_row.size(); ++i) {
      (folds.of_row[i] == fold ? out : in).push_back(static_cast<Eigen::Index>(i));
    }
    const auto path = fit_path(problem.X(in, Eigen::all), problem.y(in), penalty, options).value();
    sum += (predict(path, problem.X(out, Eigen::all), k) - problem.y(out)).squaredNorm();
  }
  return sum / static_cast<double>(problem.y.size());
}

TEST(SparseCrossValidation, IsTheErrorOfFitsThatDidNotSeeTheRow) {
  const Problem problem = random_problem(50, 10, 21);
  const Penalty penalty{PenaltyKind::Scad, 3.7};
  const PathOptions options{.lambda = log_spaced(1.0, 0.01, 20)};
  const auto grid = search(problem, penalty, five_folds(problem), options);
  ASSERT_TRUE(grid) << grid.error().text;
  for (const Eigen::Index k : {0, 10, 19}) {
    // standardised twice instead of once: rounding of columns of size 1e4
    EXPECT_NEAR(grid->error(k, 0), error_by_hand(problem, five_folds(problem), penalty, options, k),
                1e-10)
        << k;
  }
}

TEST(SparseCrossValidation, ChoosesTheSmallestErrorAndBeatsTheEmptyModel) {
  const Problem problem = random_problem(50, 10, 22);
  const auto grid = search(problem, {}, five_folds(problem));
  ASSERT_TRUE(grid) << grid.error().text;
  const double least = grid->error(grid->best.lambda, 0);
  EXPECT_EQ(least, grid->error.minCoeff());
  const double variance = (problem.y.array() - problem.y.mean()).square().mean();
  EXPECT_LT(least, 0.2 * variance);  // noise 0.09, variance above 1
}

TEST(SparseCrossValidation, OfAnEmptyModelIsTheSpreadOfTheRows) {
  const Problem problem = random_problem(50, 10, 23);
  const auto grid = search(problem, {}, five_folds(problem), {.lambda = {1e6}});
  ASSERT_TRUE(grid) << grid.error().text;
  double sum = 0.0;
  for (int fold = 0; fold < 5; ++fold) {
    std::vector<Eigen::Index> in, out;
    for (Eigen::Index i = 0; i < 50; ++i) {
      (five_folds(problem).of_row[static_cast<std::size_t>(i)] == fold ? out : in).push_back(i);
    }
    sum += (problem.y(out).array() - problem.y(in).mean()).square().sum();
  }
  EXPECT_NEAR(grid->error(0, 0), sum / 50, 1e-12);
}

TEST(SparseGridSearch, EveryColumnIsItsOwnSearchBitForBit) {
  const Problem problem = random_problem(60, 20, 24);
  const auto gamma = equally_spaced(2.001, 30.0, 11);  // more values than one register holds
  const auto grid =
      grid_search(problem.X, problem.y, PenaltyKind::Scad, gamma, five_folds(problem));
  ASSERT_TRUE(grid) << grid.error().text;

  for (std::size_t g = 0; g < gamma.size(); ++g) {
    const auto one = search(problem, {PenaltyKind::Scad, gamma[g]}, five_folds(problem)).value();
    EXPECT_TRUE(same_bits(grid->error.col(static_cast<Eigen::Index>(g)), one.error)) << gamma[g];
    EXPECT_TRUE(same_bits(grid->paths[g].coefficients, one.paths[0].coefficients)) << gamma[g];
    EXPECT_EQ(grid->paths[g].sweeps, one.paths[0].sweeps);
  }
}

/// Each half of the tasks on its own thread.
void on_two_threads(std::size_t count, const std::function<void(std::size_t)>& task) {
  const auto every_other = [&](std::size_t first) {
    for (std::size_t i = first; i < count; i += 2) {
      task(i);
    }
  };
  std::thread other(every_other, 1);
  every_other(0);
  other.join();
}

TEST(SparseGridSearch, GivesTheSameBitsOnTwoThreads) {
  const Problem problem = random_problem(60, 20, 25);
  const auto gamma = equally_spaced(1.5, 10.0, 4);
  const auto one = grid_search(problem.X, problem.y, PenaltyKind::Mcp, gamma, five_folds(problem));
  const auto two = grid_search(problem.X, problem.y, PenaltyKind::Mcp, gamma, five_folds(problem),
                               {}, on_two_threads);
  ASSERT_TRUE(one && two);
  EXPECT_TRUE(same_bits(one->error, two->error));
  EXPECT_EQ(one->best.lambda, two->best.lambda);
  EXPECT_EQ(one->best.gamma, two->best.gamma);
  for (std::size_t g = 0; g < gamma.size(); ++g) {
    EXPECT_TRUE(same_bits(one->paths[g].coefficients, two->paths[g].coefficients)) << gamma[g];
  }
}

TEST(SparseGridSearch, CellsBeyondSomeFoldsBudgetAreMissing) {
  const Problem problem = random_problem(60, 20, 26);
  const PathOptions options{.lambda = log_spaced(1.0, 1e-6, 40), .max_sweeps = 150};
  const auto grid = grid_search(problem.X, problem.y, PenaltyKind::Scad, {2.5, 20.0},
                                five_folds(problem), options);
  ASSERT_TRUE(grid) << grid.error().text;
  EXPECT_FALSE(std::isnan(grid->error(0, 0)));
  EXPECT_TRUE(std::isnan(grid->error(39, 0)));
  EXPECT_FALSE(std::isnan(grid->error(grid->best.lambda, grid->best.gamma)));
}

TEST(SparseGridSearch, TakesTheFirstOfEqualCells) {
  const Problem problem = random_problem(60, 20, 27);
  const auto grid =
      grid_search(problem.X, problem.y, PenaltyKind::Lasso, {1.0, 2.0}, five_folds(problem));
  ASSERT_TRUE(grid);
  EXPECT_EQ(grid->best.gamma, 0);
}

TEST(SparseGridSearch, RefusesFoldsThatDoNotFit) {
  const Problem problem = random_problem(20, 4, 28);
  const auto with = [&](const Folds& folds) { return search(problem, {}, folds).error(); };
  EXPECT_EQ(with(random_folds(19, 5, 1).value()).code, ErrorCode::BadInput);
  EXPECT_EQ(with({.of_row = std::vector<int>(20, 0), .count = 2}).code, ErrorCode::BadInput);
  EXPECT_EQ(with({.of_row = std::vector<int>(20, 3), .count = 2}).code, ErrorCode::BadInput);
}

TEST(SparseGridSearch, NamesTheFoldThatLeavesTooFewRows) {
  const Problem problem = random_problem(20, 4, 29);
  Folds folds{.of_row = std::vector<int>(20, 1), .count = 2};
  folds.of_row[0] = 0;  // without fold 1 only one row remains
  const auto grid = search(problem, {}, folds);
  ASSERT_FALSE(grid);
  EXPECT_EQ(grid.error().code, ErrorCode::TooFewObservations);
  EXPECT_THAT(grid.error().text, HasSubstr("without fold 1"));
}

TEST(SparseGridSearch, RefusesAnEmptyOrBadListOfGammas) {
  const Problem problem = random_problem(20, 4, 30);
  const Folds folds = random_folds(20, 4, 1).value();
  EXPECT_EQ(grid_search(problem.X, problem.y, PenaltyKind::Scad, {}, folds).error().code,
            ErrorCode::BadInput);
  EXPECT_EQ(grid_search(problem.X, problem.y, PenaltyKind::Scad, {3.0, 2.0}, folds).error().code,
            ErrorCode::BadInput);
}

}  // namespace
