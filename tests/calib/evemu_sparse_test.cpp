/// Lasso, MCP and SCAD as estimators of a ball array: the code between the sparse solver and a
/// model.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/calib/internal/sparse/cross_validation.hpp"
#include "evemu_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;

const Observations& observations() {
  static const Observations o =
      *observe_errors(reference_errors(), reference_machine(), RotationOrigin::Independent);
  return o;
}

/// A small grid and the smallest bootstrap: these tests check the code around the solver.
SolveOptions quick(Estimator estimator, FoldsBy folds = FoldsBy::Position) {
  SolveOptions options{.estimator = estimator};
  options.sparse.folds = folds;
  options.sparse.lambda = sparse::log_spaced(1e-1, 1e-6, 16);
  options.sparse.gamma = {2.5, 20.0};
  options.sparse.bootstrap_runs = 2;
  return options;
}

TEST(EvemuSparse, PredictsWhatTheSolverPredicts) {
  const Observations& o = observations();
  const Solution s = *solve(o, quick(Estimator::Scad));
  const ScaledDesign& design = s.model.polynomials()->design();
  Eigen::MatrixXd X(216, 45);
  Eigen::VectorXd y(216);

  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    X.middleRows<3>(row) = design.equivalent().X(1000 * o.rows[i].reading_m);
    y.segment<3>(row) = 1000 * o.rows[i].V_m;
  }

  sparse::PathOptions options;
  options.lambda = s.sparse->lambda;
  const sparse::Path path =
      *sparse::fit_path(X, y, {sparse::PenaltyKind::Scad, s.sparse->gamma}, options);
  const Eigen::VectorXd beta = path.coefficients.col(path.reached() - 1);  // intercept first
  const Eigen::VectorXd expected_mm = (X * beta.tail(X.cols())).array() + beta(0);

  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Vector3 V_mm = 1000 * design.B(o.rows[i].reading_m) * s.raw_c_m;
    // Monomials of mm span 1e9: distinguishing them costs nine digits.
    EXPECT_LT((V_mm - expected_mm.segment<3>(static_cast<Eigen::Index>(3 * i))).norm(), 1e-6);
  }
}

TEST(EvemuSparse, ChoosesTheSmallestHeldOutError) {
  for (const Estimator e : {Estimator::Lasso, Estimator::Mcp, Estimator::Scad}) {
    const Solution s = *solve(observations(), quick(e));
    ASSERT_TRUE(s.sparse);
    const auto l = static_cast<Eigen::Index>(s.sparse->lambda.size()) - 1;
    const auto g =
        std::find(s.sparse->all_gamma.begin(), s.sparse->all_gamma.end(), s.sparse->gamma) -
        s.sparse->all_gamma.begin();
    const double chosen = s.sparse->error_mm2(l, g);
    for (const double other : s.sparse->error_mm2.reshaped()) {
      EXPECT_FALSE(other < chosen);
    }
    EXPECT_LT(s.statistics.after.rms_m, 0.05 * s.statistics.before.rms_m) << name(e);
  }
}

TEST(EvemuSparse, LooksBetterByRowsThanItIs) {
  // Rows of one ball have touches in common, rows of one position Ball1.
  const auto least = [](FoldsBy folds) {
    double least_mm2 = std::numeric_limits<double>::infinity();
    const Solution s = *solve(observations(), quick(Estimator::Scad, folds));
    for (const double e : s.sparse->error_mm2.reshaped()) {
      least_mm2 = e < least_mm2 ? e : least_mm2;
    }
    return least_mm2;
  };
  const double by_row = least(FoldsBy::Row);
  EXPECT_LT(by_row, least(FoldsBy::Position));
  EXPECT_LT(by_row, least(FoldsBy::Ball));
}

TEST(EvemuSparse, TakesFoldsAsTheyAreGiven) {
  SolveOptions options = quick(Estimator::Lasso), by_position = quick(Estimator::Lasso);
  std::vector<int> label;
  for (const BallError& row : observations().rows) {
    label.insert(label.end(), 3, row.position);
  }
  options.sparse.given_folds = *sparse::folds_from_labels(label);
  EXPECT_EQ(solve(observations(), options)->raw_c_m, solve(observations(), by_position)->raw_c_m);
  label.pop_back();
  options.sparse.given_folds = *sparse::folds_from_labels(label);
  EXPECT_EQ(solve(observations(), options).error().code, ErrorCode::BadInput);
}

TEST(EvemuSparse, HasABootstrapOfTheSizeOfTheNoise) {
  SolveOptions options = quick(Estimator::Lasso);
  options.sparse.bootstrap_runs = 60;
  const Solution s = *solve(observations(), options), again = *solve(observations(), options),
                 ols = *solve(observations(), {.estimator = Estimator::Ols});
  EXPECT_EQ(s.covariance, CovarianceKind::Bootstrap);
  EXPECT_EQ(s.model.polynomials()->covariance_m2(), again.model.polynomials()->covariance_m2());
  const Vector3 q(0.4, 0.15, 0.045);
  const double u_m = std::sqrt(s.model.error_at(q, Vector3::Zero()).cov_V_m2.trace()),
               u_ols_m = std::sqrt(ols.model.error_at(q, Vector3::Zero()).cov_V_m2.trace());
  EXPECT_GT(u_m, 0.2 * u_ols_m);  // shrinking reduces the scatter, but not to zero
  EXPECT_LT(u_m, 2.0 * u_ols_m);
}

TEST(EvemuSparse, NeedsABootstrapForItsUncertainty) {
  for (const int runs : {-1, 0, 1}) {
    SolveOptions options = quick(Estimator::Lasso);
    options.sparse.bootstrap_runs = runs;
    const auto refused = solve(observations(), options);
    ASSERT_FALSE(refused) << runs;
    EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
    EXPECT_THAT(refused.error().text, testing::HasSubstr("bootstrap_runs = "));
  }
}

/// The budget of sweeps is used up before the chosen lambda.
TEST(EvemuSparse, IsNotConvergedAboveTheLambdaItWasAskedFor) {
  SolveOptions options = quick(Estimator::Lasso);
  options.sparse.chosen = solve(observations(), options)->sparse;
  options.sparse.max_sweeps = 20;
  const auto refused = solve(observations(), options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::NotConverged);
  EXPECT_THAT(refused.error().text, testing::HasSubstr("max_sweeps = 20 was reached at lambda"));
}

/// Without a position the chosen path takes more sweeps than the path with it.
TEST(EvemuSparse, RefitsWithTheLambdaThatWasChosen) {
  SolveOptions options = quick(Estimator::Scad);
  options.sparse.chosen = solve(observations(), options)->sparse;
  EXPECT_TRUE(held_out(observations(), 1e-6, nullptr, options));
  options.sparse.max_sweeps = 5000;
  const auto refused = held_out(observations(), 1e-6, nullptr, options);
  ASSERT_FALSE(refused);
  EXPECT_THAT(
      refused.error().text,
      testing::ContainsRegex("without position [0-9]+: sparse fit \\(scad, gamma 2\\.5\\)"));
}

TEST(EvemuSparse, PredictsPositionsItWasNotFittedTo) {
  const SolveOptions options = quick(Estimator::Scad);
  const Solution s = *solve(observations(), options);
  const double s_m = solve(observations())->statistics.s_m;
  SolveOptions fixed = options;
  fixed.sparse.chosen = s.sparse;
  const auto figures = held_out(observations(), s_m, nullptr, fixed);
  ASSERT_TRUE(figures) << figures.error().text;
  EXPECT_LT(figures->candidate_rms_m, 0.2 * figures->no_compensation_rms_m);
}

}  // namespace
