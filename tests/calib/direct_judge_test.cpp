/// Verdicts on simulated tables: how often they are wrong, and what they cannot find.

#include "abbe/calib/internal/direct/judge.hpp"

#include <gmock/gmock.h>

#include <random>

#include "abbe/calib/internal/direct/convention.hpp"
#include "abbe/calib/internal/direct/scatter.hpp"

namespace abbe::calib::direct {
namespace {

constexpr std::size_t kTables = 12, kPositions = 13;
constexpr ErrorMotion kEXX{Motion::X, Axis::X};

/// A table whose measured values and whose model have errors of the stated size.
class SimulatedTable {
 public:
  SimulatedTable(int runs, double u_model) : runs_(runs), u_model_(u_model) {
    for (std::size_t i = 0; i < kPositions; ++i) {
      positions_m_.push_back(-0.3 + 0.05 * static_cast<double>(i));
    }
  }

  /// `scatter`: of the mean over the runs; `slope`: scatter of the slopes of the runs.
  TableComparison judged(std::mt19937_64& random, double scatter, double slope = 0.0,
                         double model_value = 1.0) const {
    std::normal_distribution<double> normal;
    const double of_run = scatter * std::sqrt(static_cast<double>(runs_));
    const auto noise = [&](double u) { return u * normal(random); };
    Runs runs{.positions_m = positions_m_, .values = {}, .reversal = {}};
    for (int r = 0; r < runs_; ++r) {
      const double of_slope = noise(slope);
      Eigen::VectorXd values(static_cast<Eigen::Index>(kPositions));
      for (std::size_t i = 0; i < kPositions; ++i) {
        values(static_cast<Eigen::Index>(i)) = noise(of_run) + of_slope * positions_m_[i];
      }
      runs.values.push_back(values);
    }

    const Eigen::MatrixXd P = reduction(kEXX, positions_m_, 0.0, StraightnessLine::EndPoints);
    Eigen::VectorXd model = Eigen::VectorXd::Zero(P.rows());
    for (double& value : model) {
      value = noise(u_model_);
    }
    const Scatter found = scatter_of(runs, kEXX);
    TableComparison table;
    table.runs = runs.values.size();
    const Eigen::VectorXd offset = Eigen::VectorXd::Constant(P.rows(), model_value);
    add_points(table, runs, P * runs.mean() + offset, P * model + offset,
               {covariance_of_runs(runs, kEXX, found, P), Eigen::MatrixXd::Zero(P.rows(), P.rows()),
                u_model_ * u_model_ * P * P.transpose()},
               uncertainty_known(kEXX, found, {}));
    judge(table, limits_of(0.05 / static_cast<double>(kTables * kPositions), found.dof));
    return table;
  }

 private:
  int runs_;
  double u_model_;
  std::vector<double> positions_m_;
};

/// Share of comparisons of 12 tables of the same machine of which any contradicts.
double false_alarms(const SimulatedTable& simulated, double scatter, double slope = 0.0) {
  constexpr int kComparisons = 100;
  std::mt19937_64 random(7);
  int alarms = 0;
  for (int i = 0; i < kComparisons; ++i) {
    bool any = false;
    for (std::size_t k = 0; k < kTables; ++k) {
      any = simulated.judged(random, scatter, slope).finding == Finding::Contradicts || any;
    }
    alarms += any ? 1 : 0;
  }
  return static_cast<double>(alarms) / kComparisons;
}

/// 0.05 and three standard deviations of the share found in 100 comparisons.
constexpr double kMostFalseAlarms = 0.05 + 3.0 * 0.0218;

TEST(DirectJudge, IsSeldomWrongWithFewRuns) {
  for (const int runs : {2, 3, 5}) {
    for (const double u_model : {1e-6, 0.1e-6}) {
      EXPECT_LE(false_alarms({runs, u_model}, 1e-6), kMostFalseAlarms) << runs << " " << u_model;
    }
  }
}

/// Runs at different temperatures of the scales: the scatter is one slope per run.
TEST(DirectJudge, DoesNotTakeTheSlopesOfTwoRunsForManyIndependentValues) {
  std::mt19937_64 random(7);
  const TableComparison white = SimulatedTable(2, 0.1e-6).judged(random, 1e-6);
  const TableComparison slopes = SimulatedTable(2, 0.1e-6).judged(random, 1e-9, 10e-6);
  EXPECT_GT(white.points.front().limit / white.points.front().u_runs, 4.0);
  EXPECT_GT(slopes.points.front().limit / slopes.points.front().u_runs, 8.0);
}

TEST(DirectJudge, DoesNotCallAgreementWhatItCannotDistinguishFromNoErrors) {
  std::mt19937_64 random(7);
  const TableComparison coarse = SimulatedTable(2, 0.1e-6).judged(random, 1e-6, 0.0, 1e-6);
  EXPECT_EQ(coarse.finding, Finding::NotTested);
  EXPECT_THAT(coarse.reason, ::testing::HasSubstr("would not be found"));
  EXPECT_GT(coarse.revealed, 1e-6);
  EXPECT_EQ(SimulatedTable(5, 0.1e-6).judged(random, 0.1e-6, 0.0, 3e-6).finding, Finding::Agrees);
}

TEST(DirectJudge, OfASquarenessInTwoRunsKnowsLittle) {
  Runs runs{.positions_m = {0.0}, .values = {}, .reversal = {}};
  runs.values = {Eigen::VectorXd::Constant(1, 1e-6), Eigen::VectorXd::Constant(1, 1.2e-6)};
  const Scatter found = scatter_of(runs, std::nullopt);
  EXPECT_EQ(found.dof, 1u);
  EXPECT_NEAR(found.variance, 0.02e-12, 1e-18);
  runs.values[1] = runs.values[0];
  EXPECT_FALSE(uncertainty_known(std::nullopt, scatter_of(runs, std::nullopt), {})) << "no scatter";
}

TEST(DirectJudge, NeedsMoreThanTheScaleOfTheDevice) {
  EXPECT_FALSE(uncertainty_known(kEXX, {}, {.u_scale = 1e-6}));
  EXPECT_FALSE(uncertainty_known(kEXX, {}, {.u_rad = 1e-6}));
  EXPECT_TRUE(uncertainty_known(kEXX, {}, {.u_m = 1e-6}));
  EXPECT_FALSE(uncertainty_known(std::nullopt, {}, {.u_m = 1e-6}));
}

}  // namespace
}  // namespace abbe::calib::direct
