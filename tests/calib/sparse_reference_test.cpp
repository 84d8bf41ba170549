/// Compared with ncvreg 3.16.0.7. Requirement: 1e-10 in standardised units, with equal sweep counts
/// and missing cells. Rounding alone (another order of summation, amplified by columns with a
/// condition number of 2e3) gives differences up to 3e-11.

#include <gtest/gtest.h>

#include "abbe/calib/internal/sparse/cross_validation.hpp"
#include "sparse_reference.hpp"

namespace {
using namespace abbe::calib::sparse;
using namespace abbe::tests::sparse;

constexpr double kAsked = 1e-10;

std::filesystem::path folder() {
  return std::filesystem::path(ABBE_TEST_DATA) / "evemu";
}

const BallArrayProblem& problem() {
  static const BallArrayProblem read = ball_array_problem(folder());
  return read;
}

/// Largest difference of coefficients, in standardised units.
double scaled_difference(const Eigen::MatrixXd& ours, const Eigen::MatrixXd& theirs) {
  const Eigen::MatrixXd slopes =
      problem().scale.asDiagonal() * (ours - theirs).bottomRows(ours.rows() - 1);
  return std::max(slopes.cwiseAbs().maxCoeff(), (ours - theirs).row(0).cwiseAbs().maxCoeff());
}

TEST(SparseReference, PathsOfAllPenaltiesAreThoseOfNcvreg) {
  const auto references = reference_paths(folder());
  ASSERT_EQ(references.size(), 14U);  // SCAD and MCP at three gammas, lasso; two tolerances
  for (const ReferencePath& reference : references) {
    SCOPED_TRACE(testing::Message()
                 << name(reference.penalty.kind) << " gamma " << reference.penalty.gamma
                 << " tolerance " << reference.options.tolerance);
    const auto path = fit_path(problem().X, problem().y, reference.penalty, reference.options);
    ASSERT_TRUE(path) << path.error().text;
    EXPECT_EQ(path->sweeps, reference.sweeps);
    ASSERT_EQ(path->reached(), reference.coefficients.cols());
    EXPECT_LE(scaled_difference(path->coefficients, reference.coefficients), kAsked);
  }
}

/// Every seventh gamma, from 2.0001 to 100: the benchmark checks the whole grid.
ReferenceGrid decimated(const ReferenceGrid& grid) {
  ReferenceGrid out{.gamma = {}, .options = grid.options, .error = {}};
  const auto some = Eigen::seq(0, grid.error.cols() - 1, 7);
  out.error = grid.error(Eigen::all, some);
  for (std::size_t g = 0; g < grid.gamma.size(); g += 7) {
    out.gamma.push_back(grid.gamma[g]);
  }
  return out;
}

class SparseReferenceGrid : public testing::TestWithParam<const char*> {
 protected:
  [[nodiscard]] static Folds folds() {
    const bool by_ball = std::string(GetParam()) == "ncvreg_default_byball";
    return reference_folds(folder(), by_ball ? "fold216_byball.csv" : "fold216.csv");
  }
};

TEST_P(SparseReferenceGrid, ErrorsAndMissingCellsAreThoseOfNcvreg) {
  const ReferenceGrid reference = decimated(reference_grid(folder(), GetParam()));
  const auto grid = grid_search(problem().X, problem().y, PenaltyKind::Scad, reference.gamma,
                                folds(), reference.options);
  ASSERT_TRUE(grid) << grid.error().text;
  const auto missing = reference.error.array().isNaN();
  EXPECT_TRUE((grid->error.array().isNaN() == missing).all());
  EXPECT_LE(missing.select(0.0, grid->error - reference.error).cwiseAbs().maxCoeff(), kAsked);
}

TEST_P(SparseReferenceGrid, PathAtTheBestGammaIsThatOfNcvreg) {
  const ReferenceGrid reference = reference_grid(folder(), GetParam());
  Eigen::Index row = 0, column = 0;
  reference.error.array().isNaN().select(1.0, reference.error).minCoeff(&row, &column);
  const auto grid =
      grid_search(problem().X, problem().y, PenaltyKind::Scad,
                  {reference.gamma[static_cast<std::size_t>(column)]}, folds(), reference.options);
  ASSERT_TRUE(grid) << grid.error().text;
  EXPECT_EQ(grid->best.lambda, row);

  const Eigen::MatrixXd expected =
      numbers(read_table(folder(), std::string(GetParam()) + "_path.csv"));
  const Path& path = grid->paths.front();
  ASSERT_EQ(path.reached(), expected.rows());
  EXPECT_EQ(path.sweeps, std::vector<long>(expected.col(1).begin(), expected.col(1).end()));
  EXPECT_LE(scaled_difference(path.coefficients, expected.rightCols(46).transpose()), kAsked);
  EXPECT_LE((path.residual_sum_squares - expected.col(2)).cwiseAbs().maxCoeff(), kAsked);
}

INSTANTIATE_TEST_SUITE_P(Folds, SparseReferenceGrid,
                         testing::Values("ncvreg_default", "ncvreg_default_byball"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
