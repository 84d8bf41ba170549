// A short version of the campaign of scripts/soak never-worse: a few machines, some faults, and the
// seeds of known wrong acceptances.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "evemu_run.hpp"
#include "repetitions.hpp"

namespace {
using namespace abbe::tests::never_worse;
namespace calib = abbe::calib;

Campaign<EvemuRun> ball_array(const std::vector<std::string>& parts) {
  Campaign<EvemuRun> campaign{"ball array", evemu_faults(), random_evemu_run,
                              identify_and_compare_evemu};
  std::erase_if(campaign.faults, [&](const Fault<EvemuRun>& f) {
    return std::none_of(parts.begin(), parts.end(), [&](const std::string& part) {
      return f.name.find(part) != std::string::npos;
    });
  });
  return campaign;
}

constexpr std::uint64_t kFirstSeed = 1;

TEST(NeverWorseBallArray, NoAcceptedModelIsWorseThanNone) {
  const auto campaign =
      ball_array({"within", "wrong by 20..100", "mirrored", "swapped", "order", "creeps"});
  ASSERT_EQ(campaign.faults.size(), 9u);
  const auto tallies = tallies_of(campaign, 1, kFirstSeed);
  for (std::size_t i = 0; i < tallies.size(); ++i) {
    EXPECT_EQ(tallies[i].worse, 0) << campaign.faults[i].name;
    EXPECT_EQ(tallies[i].too_sure, 0) << campaign.faults[i].name;
  }
}

// If the noise model contains white noise only, the model of the first of these runs is wrong by
// 3.1 times its uncertainty u.
TEST(NeverWorseBallArray, SlowNoiseIsInTheUncertainty) {
  const auto slow = tallies_of(ball_array({"slow noise"}), 2, 5000).front();
  EXPECT_EQ(slow.runs, 2);
  EXPECT_EQ(slow.too_sure, 0) << slow.largest_left_over_u;
}

// The false touch increases the estimated uncertainty so much that it covers the effect of the
// touch. It also makes the ball centres scatter; this scatter must not be named as the cause.
TEST(NeverWorseBallArray, AFalseTouchIsNamedBeforeTheScatterThatFollows) {
  const auto tally = tallies_of(ball_array({"false trigger"}), 1, 7004).front();
  EXPECT_EQ(tally.accepted, 0);
  EXPECT_EQ(tally.named, 1) << tally.other_reason;
}

// The model of this run is wrong by 3.3 times its uncertainty u. It would be accepted if the errors
// within a ball were compared with the uncertainty of another estimate.
TEST(NeverWorseBallArray, ErrorsWithinABallAreNotLargeBesideTheUncertainty) {
  const auto screw = tallies_of(ball_array({"screw pitch"}), 1, 8092).front();
  EXPECT_EQ(screw.accepted, 0) << screw.largest_left_over_u;
  EXPECT_EQ(screw.named, 1) << screw.other_reason;
}

// The array is flat. The likelihood hardly distinguishes noise from a scale of the axis across the
// array; with the scale, the error of the machine after correction is 36 um, and 11 um before.
TEST(NeverWorseBallArray, NoiseThatLooksLikeAScaleIsRefused) {
  const auto slow = tallies_of(ball_array({"slow noise"}), 1, 579).front();
  EXPECT_EQ(slow.runs, 1);
  EXPECT_EQ(slow.accepted, 0) << slow.largest_left_over_u;
}

// In the first run the likelihood ratio of a drift is only e^10.7, but the drift moves the model by
// 3.1 times its uncertainty u. In the second run the drift is certain and moves the model by 0.8 u.
TEST(NeverWorseBallArray, DriftThatTheUncertaintyDoesNotCoverIsNamed) {
  for (const std::uint64_t seed : {82u, 665u}) {
    const auto drift = tallies_of(ball_array({"drifts"}), 1, seed).front();
    EXPECT_EQ(drift.accepted, 0) << drift.largest_left_over_u;
    EXPECT_EQ(drift.named, 1) << drift.other_reason;
  }
}

TEST(NeverWorseBallArray, TheUncertaintyCoversEstimatesThatTheDataDoNotDistinguish) {
  EvemuRun run = random_evemu_run(579);
  run.slow_noise_m = 9e-6;
  const auto seen =
      calib::evemu::observe(touches_of(run), run.calibrator, run.machine, run.observe);
  ASSERT_TRUE(seen);
  const auto solution = calib::evemu::solve(*seen);
  ASSERT_TRUE(solution);
  const double u_m = calib::evemu::correction_size(*seen, *solution).u_m;
  constexpr double kRounding = 1e-6;
  EXPECT_GT(solution->statistics.comparable_m, 0.0);
  EXPECT_GE(u_m, (1.0 - kRounding) * solution->statistics.comparable_m);
}

TEST(NeverWorseBallArray, SoundRunsAreAccepted) {
  const auto none =
      tallies_of(ball_array({"none"}), abbe::tests::repetitions(4), kFirstSeed).front();
  EXPECT_EQ(none.accepted, none.runs) << none.other_reason;
  EXPECT_EQ(none.worse, 0);
}

}  // namespace
