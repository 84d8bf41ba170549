#include "abbe/calib/internal/otf/samples/standstill.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "abbe/calib/internal/otf/standstill/observe_standstills.hpp"
#include "standstill_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kRate_hz = 250.0;

MadeRun short_run() {
  return make_standstill_run({.positions = 10});
}

/// Indices of the samples taken between two times after the arrival at a position.
std::pair<std::size_t, std::size_t> samples_at(const MadeRun& run, std::size_t position,
                                               double from_s, double to_s) {
  const auto found = find_standstills(make_standstill_run({.positions = 10}).samples);
  const double begin_s = found->found.at(position).begin_s;
  const auto index = [&](double after_s) {
    return std::min(run.samples.size(),
                    static_cast<std::size_t>(std::lround((begin_s + after_s) * kRate_hz)));
  };
  return {index(from_s), index(to_s)};
}

TEST(Standstill, FindsEveryStopOfTheMachine) {
  const auto all = find_standstills(short_run().samples);
  ASSERT_TRUE(all) << all.error().text;
  ASSERT_EQ(all->found.size(), 10u);
  for (const Standstill& s : all->found) {
    EXPECT_GT(s.end_s - s.begin_s, 0.7);  // 1 s less settling and windows
    EXPECT_LT(s.end_s - s.begin_s, 1.0);
    EXPECT_EQ(s.samples + s.outliers, s.last_sample - s.first_sample + 1);
  }
}

TEST(Standstill, StatesTheScatterOfItsSamplesAlongTheBeam) {
  const MadeRun run = short_run();
  const auto all = find_standstills(run.samples);
  for (const Standstill& s : all->found) {
    const double across_m = run.noise.sigma_angle_rad * s.mean_tracker_m.norm();
    const double tolerance = 4.0 / std::sqrt(2.0 * static_cast<double>(s.samples));
    EXPECT_NEAR(s.scatter_m(0) / run.noise.sigma_range_m, 1.0, tolerance);
    EXPECT_NEAR(s.scatter_m(1) / across_m, 1.0, tolerance);
    EXPECT_NEAR(s.scatter_m(2) / across_m, 1.0, tolerance);
  }
  EXPECT_EQ(all->correlation, Vector3::Ones());  // white noise
}

TEST(Standstill, ContinuesOverLostSamplesAndAShortBreak) {
  for (const bool missing : {false, true}) {
    MadeRun run = short_run();
    const auto [from, to] = samples_at(run, 4, 0.2, 0.5);
    if (missing) {
      run.samples.erase(run.samples.begin() + static_cast<std::ptrdiff_t>(from),
                        run.samples.begin() + static_cast<std::ptrdiff_t>(to));
    } else {
      for (std::size_t i = from; i < to; ++i) run.samples[i].valid = false;
    }
    const auto all = find_standstills(run.samples);
    ASSERT_EQ(all->found.size(), 10u);
    EXPECT_GT(all->found[4].end_s - all->found[4].begin_s, 0.7);
    EXPECT_EQ(all->found[4].lost_samples, missing ? 0u : to - from);
  }
}

TEST(Standstill, EndsAtABreakIfTheTargetIsElsewhereAfterIt) {
  MadeRun run = short_run();
  const auto [from, to] = samples_at(run, 4, 0.3, 0.4);
  for (std::size_t i = from; i < run.samples.size(); ++i) {
    run.samples[i].valid = i >= to;
    run.samples[i].p_tracker_m.x() += 100e-6;
  }
  EXPECT_EQ(find_standstills(run.samples)->found.size(), 11u);
}

TEST(Standstill, LeavesOutASampleThatIsFarOff) {
  MadeRun run = short_run();
  const std::size_t at = samples_at(run, 4, 0.4, 0.4).first;
  run.samples[at].p_tracker_m.y() += 0.2e-3;
  const auto all = find_standstills(run.samples);
  ASSERT_EQ(all->found.size(), 10u);
  EXPECT_GE(all->found[4].outliers, 1u);
  EXPECT_LT(all->found[4].scatter_m.maxCoeff(), 10e-6);
}

TEST(Standstill, StatesCreepAndCorrelationOfAVibration) {
  MadeRun creeping = short_run(), vibrating = short_run();
  for (std::size_t i = 0; i < creeping.samples.size(); ++i) {
    const double t = creeping.samples[i].time_s;
    creeping.samples[i].p_tracker_m.z() += 20e-6 * t;
    vibrating.samples[i].p_tracker_m.z() += 5e-6 * std::sin(2.0 * M_PI * 30.0 * t);
  }
  const auto slow = find_standstills(creeping.samples), fast = find_standstills(vibrating.samples);
  ASSERT_EQ(slow->found.size(), 10u);
  const Standstill& s = slow->found[3];
  EXPECT_NEAR(s.creep_m.norm(), 20e-6 * (s.end_s - s.begin_s), 5e-6);
  ASSERT_EQ(fast->found.size(), 10u);
  EXPECT_GT(fast->correlation(2), 1.3);
}

TEST(Standstill, DoesNotTakeSlowMotionForAStandstill) {
  MadeRun run = short_run();
  const auto [from, to] = samples_at(run, 4, -0.3, 1.0);
  for (std::size_t i = from; i < to; ++i) {
    run.samples[i].p_tracker_m.x() += 0.15e-3 * static_cast<double>(i - from) / kRate_hz;
  }
  const auto all = find_standstills(run.samples);
  EXPECT_EQ(all->found.size(), 9u);
  EXPECT_EQ(all->creeping, 1u);
}

TEST(Standstill, FindsTheSameWithTheTimesAtWhichBurstsWereDelivered) {
  MadeRun run = short_run();
  constexpr std::size_t kBurst = 83;  // 332 ms
  for (std::size_t i = 0; i < run.samples.size(); ++i) {
    run.samples[i].time_s =
        0.332 * static_cast<double>(i / kBurst + 1) + 1e-6 * static_cast<double>(i % kBurst);
  }
  const auto clock = find_standstills(short_run().samples), bursts = find_standstills(run.samples);
  ASSERT_TRUE(bursts) << bursts.error().text;
  ASSERT_EQ(bursts->found.size(), clock->found.size());
  EXPECT_NEAR(bursts->period_s, clock->period_s, 0.05 * clock->period_s);
  for (std::size_t i = 0; i < clock->found.size(); ++i) {
    EXPECT_LT((bursts->found[i].mean_tracker_m - clock->found[i].mean_tracker_m).norm(), 2e-6);
  }
}

TEST(Standstill, NamesSampleAndTimeOfATimeThatDoesNotAscend) {
  MadeRun run = short_run();
  run.samples[100].time_s = run.samples[99].time_s;
  EXPECT_THAT(find_standstills(run.samples).error().text, HasSubstr("sample 100 at 0.396 s"));
}

TEST(Standstill, ReportsAStreamWithoutOne) {
  const MadeRun run = make_run({});  // stops of 0.1 s
  const auto none = find_standstills(run.samples);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::TooFewObservations);
  EXPECT_THAT(none.error().text, HasSubstr("stops were shorter"));
}

TEST(UOfMeans, IsLargerThanWhiteNoiseForCorrelatedSamples) {
  MadeRun run = short_run();
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  double held = 0.0;
  for (TrackerObservation& s : run.samples) {  // correlated over 20 samples
    held = 0.95 * held + std::sqrt(1.0 - 0.95 * 0.95) * normal(random);
    s.p_tracker_m += 4e-6 * held * s.p_tracker_m.normalized();
  }
  const auto all = find_standstills(run.samples);
  const std::vector<Vector3> u_m = u_of_means_m(*all, run.noise, 0.0);
  double squares = 0.0;
  for (const Vector3& u : u_m) squares += u.x() * u.x() / static_cast<double>(u_m.size());
  // Variance of a mean of n samples with autocorrelation 0.95^k: 39 of them count as one.
  const double expected_m = 4e-6 * std::sqrt(39.0 / static_cast<double>(all->found[1].samples));
  EXPECT_NEAR(std::sqrt(squares) / expected_m, 1.0, 0.35);
}

TEST(UOfMeans, IsNotBelowTheRepeatability) {
  const MadeRun run = short_run();
  const auto all = find_standstills(run.samples);
  for (const Vector3& u : u_of_means_m(*all, run.noise, 1e-6)) EXPECT_GE(u.minCoeff(), 1e-6);
}

}  // namespace
