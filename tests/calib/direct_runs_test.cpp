/// Runs of a direct device: means, scatter, backlash, and what is refused.

#include "abbe/calib/direct/runs.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace abbe::calib::direct {
namespace {

using ::testing::HasSubstr;

/// Two runs at three positions, forward and backward.
MeasuredError two_runs() {
  MeasuredError error{.name = "EXX", .readings = {}};
  const double forward[2][3] = {{0e-6, 1e-6, 2e-6}, {1e-6, 2e-6, 4e-6}};
  for (int run = 1; run <= 2; ++run) {
    for (int i = 0; i < 3; ++i) {
      const double value = forward[run - 1][i];
      error.readings.push_back({0.1 * i, value, run, true});
      error.readings.push_back({0.1 * i, value - (run == 1 ? 2e-6 : 4e-6), run, false});
    }
  }
  return error;
}

TEST(DirectRuns, AreMeansOfBothDirections) {
  const Runs runs = *runs_of(two_runs());
  ASSERT_EQ(runs.values.size(), 2u);
  EXPECT_NEAR(runs.values[0](2), 1e-6, 1e-15);
  EXPECT_NEAR(runs.values[1](2), 2e-6, 1e-15);
  EXPECT_NEAR(runs.mean()(2), 1.5e-6, 1e-15);
}

/// s / sqrt(n) of two runs that differ by d: d / 2.
TEST(DirectRuns, HaveTheStandardUncertaintyOfTheirMean) {
  const Runs runs = *runs_of(two_runs());
  const Eigen::MatrixXd C = runs.covariance_of_mean(Eigen::MatrixXd::Identity(3, 3));
  EXPECT_NEAR(std::sqrt(C(2, 2)), 0.5e-6, 1e-15);
}

TEST(DirectRuns, DoNotCountAsScatterWhatTheConventionRemoves) {
  MeasuredError error = two_runs();
  for (Reading& r : error.readings) {
    r.value += 100e-6 * r.run;  // every run is zeroed elsewhere
  }
  Eigen::MatrixXd zero_at_first = Eigen::MatrixXd::Identity(3, 3);
  zero_at_first.col(0).array() -= 1.0;
  const Eigen::MatrixXd C = runs_of(error)->covariance_of_mean(zero_at_first);
  EXPECT_NEAR(C(0, 0), 0.0, 1e-24);
  EXPECT_NEAR(std::sqrt(C(2, 2)), 0.5e-6, 1e-12);
}

TEST(DirectRuns, GiveTheReversalWithItsUncertainty) {
  const auto reversal = reversal_of(*runs_of(two_runs()));
  ASSERT_TRUE(reversal);
  EXPECT_NEAR(reversal->mean, 3e-6, 1e-15);
  EXPECT_NEAR(*reversal->u, 1e-6, 1e-15);
  EXPECT_NEAR(reversal->largest, 3e-6, 1e-15);
}

TEST(DirectRuns, LeaveOutPositionsThatARunDoesNotHave) {
  MeasuredError error = two_runs();
  error.readings.erase(error.readings.begin());
  const Runs runs = *runs_of(error);
  EXPECT_EQ(runs.positions_m.size(), 2u);
  EXPECT_EQ(runs.left_out, 1u);
}

TEST(DirectRuns, TakePositionsOfOneTargetTogether) {
  MeasuredError error = two_runs();
  error.readings[0].position_m += 0.5 * kSameTarget_m;
  EXPECT_EQ(runs_of(error)->positions_m.size(), 3u);
}

TEST(DirectRuns, RefuseARunThatIsThereTwice) {
  MeasuredError error = two_runs();
  error.readings.push_back(error.readings.front());
  const auto runs = runs_of(error);
  ASSERT_FALSE(runs);
  EXPECT_THAT(runs.error().text, HasSubstr("two forward values at 0 mm"));
}

TEST(DirectRuns, RefuseACopyUnderAnotherNumber) {
  MeasuredError error = two_runs();
  const std::vector<Reading> first(error.readings.begin(), error.readings.begin() + 6);
  for (Reading r : first) {
    r.run = 3;
    error.readings.push_back(r);
  }
  const auto runs = runs_of(error);
  ASSERT_FALSE(runs);
  EXPECT_THAT(runs.error().text, HasSubstr("run 3 has exactly the values of run 1"));
}

TEST(DirectRuns, RefuseAMixtureOfDirections) {
  MeasuredError error = two_runs();
  error.readings.push_back({0.0, 0.0, 3, true});
  const auto runs = runs_of(error);
  ASSERT_FALSE(runs);
  EXPECT_THAT(runs.error().text, HasSubstr("run 3 has other directions"));
}

TEST(DirectRuns, NameTheNumberingOfLaserPrograms) {
  MeasuredError error = two_runs();
  for (auto& r : error.readings) r.run = 2 * r.run - (r.forward ? 1 : 0);
  const auto runs = runs_of(error);
  ASSERT_FALSE(runs);
  EXPECT_THAT(runs.error().text,
              HasSubstr("forward and backward of one cycle have the same number"));
  EXPECT_THAT(runs.error().text, HasSubstr("(1, 1, 2, 2, ...)"));
}

TEST(DirectRuns, DoNotNameTheNumberingIfARunIsIncomplete) {
  MeasuredError error = two_runs();
  std::erase_if(error.readings, [](const Reading& r) { return r.run == 2 && !r.forward; });
  EXPECT_THAT(runs_of(error).error().text, HasSubstr("leave out the incomplete runs"));
}

TEST(DirectRuns, NameReadingsInsteadOfTargets) {
  MeasuredError error = two_runs();
  double shift_m = 0.0;
  for (auto& r : error.readings) r.position_m += shift_m += 20e-6;
  const auto runs = runs_of(error);
  ASSERT_FALSE(runs);
  EXPECT_THAT(runs.error().text, HasSubstr("differ by more than 0.01 mm are different targets"));
  EXPECT_THAT(runs.error().text, HasSubstr("write the target position instead of the reading"));
}

TEST(DirectRuns, StateTheLimitAloneIfThePositionsAreOthers) {
  const MeasuredError error{
      .name = "EXX",
      .readings = {
          {0.0, 0.0, 1, true}, {0.1, 0.0, 1, true}, {0.05, 0.0, 2, true}, {0.15, 0.0, 2, true}}};
  EXPECT_THAT(runs_of(error).error().text, HasSubstr("0.01 mm"));
  EXPECT_THAT(runs_of(error).error().text, testing::Not(HasSubstr("reading")));
}

TEST(DirectRuns, RefuseNoCommonPositionAndNoNumber) {
  MeasuredError error{.name = "EXX", .readings = {{0.0, 0.0, 1, true}, {0.1, 0.0, 2, true}}};
  EXPECT_EQ(runs_of(error).error().code, ErrorCode::TooFewObservations);
  error.readings[0].value = std::nan("");
  EXPECT_EQ(runs_of(error).error().code, ErrorCode::NotFinite);
}

}  // namespace
}  // namespace abbe::calib::direct
