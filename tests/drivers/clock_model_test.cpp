#include "abbe/drivers/clock_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "burst_profile.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::ClockModel;
using drivers::ClockModelOptions;
using drivers::HostInstant;
using protocol::DeviceTime;
using protocol::HostTime;

double seconds(std::chrono::nanoseconds d) {
  return 1e-9 * static_cast<double>(d.count());
}

struct Judged {
  double error_s = 0.0;
  double u_s = 0.0;
  [[nodiscard]] bool covered() const { return error_s <= 2.0 * u_s; }  // U95 = 2 u
};

Judged judge(const ClockModel& model, const BurstProfile& profile, double host_s) {
  const HostInstant at = model.to_host(profile.device_at(host_s));
  return {seconds(std::chrono::abs(at.time - profile.host_at(host_s))), seconds(at.u_time)};
}

void run(BurstProfile& profile, ClockModel& model, double until_s) {
  while (profile.last_point_s() < until_s) {
    const Packet p = profile.next();
    model.observe(p.last_point, p.arrival);
  }
}

constexpr std::uint64_t kSeeds = 50;
// the model's coefficients were chosen on seeds 0 to 399
constexpr std::uint64_t kFirstSeed = 900'000;

/// The measured profile with 15 ppm and an unknown constant delay of 0 to 2 ms.
BurstProfile measured(std::uint64_t seed) {
  return {
      seed,
      {.skew = 15e-6, .constant_delay_s = 0.002 * BurstProfile(5'000'000 + seed, {}).uniform()}};
}

TEST(ClockModel, ErrsByLessThan2msAfterAMinute) {
  for (std::uint64_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
    BurstProfile profile = measured(seed);
    ClockModel model;
    for (run(profile, model, 60.0); profile.last_point_s() < 120.0;) {
      run(profile, model, profile.last_point_s() + 0.1);  // one more packet
      EXPECT_LE(judge(model, profile, profile.last_point_s() - 0.330).error_s, 0.002)
          << "seed " << seed;
      EXPECT_LE(judge(model, profile, profile.last_point_s()).error_s, 0.002) << "seed " << seed;
    }
  }
}

TEST(ClockModel, StatesAnUncertaintyThatCoversTheTruth) {
  std::uint64_t covered = 0;
  for (std::uint64_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
    BurstProfile profile = measured(seed);
    ClockModel model;
    run(profile, model, 60.0);
    const Judged last = judge(model, profile, profile.last_point_s());
    covered += last.covered() ? 1 : 0;
    EXPECT_LT(last.u_s, 0.002) << "an uncertainty that says nothing, seed " << seed;
  }
  EXPECT_GE(covered, 45u);
}

// Without the constant delay only the fit is left, and its own share of the uncertainty has to
// cover it.
TEST(ClockModel, StatesTheUncertaintyOfItsEnvelope) {
  std::uint64_t covered = 0;
  double sum_of_u_s = 0.0;
  for (std::uint64_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
    BurstProfile profile(seed, {});
    ClockModel model({.max_constant_delay = 0ns});
    run(profile, model, 60.0);
    const Judged last = judge(model, profile, profile.last_point_s());
    covered += last.covered() ? 1 : 0;
    sum_of_u_s += last.u_s;
  }
  EXPECT_GE(covered, 45u);
  EXPECT_LT(sum_of_u_s / kSeeds, 0.0007);  // the packets scatter by 7 ms
}

TEST(ClockModel, FindsTheSkew) {
  ClockModel model;
  BurstProfile profile(7, {.skew = 60e-6});
  run(profile, model, 120.0);
  EXPECT_NEAR(model.status().skew, 60e-6, 20e-6);  // 0.3 ms at either end of a quarter of a minute
}

TEST(ClockModel, HoldsTheSkewWithinItsBound) {
  ClockModel model({.max_skew = 50e-6});
  BurstProfile profile(7, {.skew = 150e-6});
  run(profile, model, 120.0);
  EXPECT_LE(model.status().skew, 50.0001e-6);
}

TEST(ClockModel, ReportsASkewBeyondItsBoundAndNeverSettlesOnIt) {
  for (const double skew : {300e-6, -300e-6}) {
    ClockModel model;
    BurstProfile profile(7, {.skew = skew});
    run(profile, model, 120.0);
    EXPECT_NEAR(model.skew_beyond_limit(), skew, 30e-6);
    EXPECT_FALSE(model.status().settled);
    EXPECT_GT(model.status().u_time, 4ms);  // 100 ppm over a minute
  }
}

TEST(ClockModel, DoesNotMistakeScatterForASkewBeyondItsBound) {
  constexpr std::uint64_t kManySeeds = 200;
  for (std::uint64_t seed = 0; seed < kManySeeds; ++seed) {
    ClockModel model;
    BurstProfile profile(seed, {.skew = 60e-6});
    for (int part = 1; part <= 6; ++part) {
      run(profile, model, 20.0 * part);
      ASSERT_EQ(model.skew_beyond_limit(), 0.0) << "seed " << seed;
    }
  }
}

TEST(ClockModel, IsUnsettledWithARealisticUncertaintyAtFirst) {
  ClockModel model;
  EXPECT_FALSE(model.to_host(DeviceTime{}).settled);
  model.observe(DeviceTime{5s}, HostTime{100s});
  const HostInstant at = model.to_host(DeviceTime{5s});
  EXPECT_FALSE(at.settled);
  EXPECT_GE(at.u_time, 10ms);  // the one arrival may have been late by tens of ms
}

TEST(ClockModel, SettlesAfterTheConfiguredNumberOfArrivals) {
  ClockModel model({.settled_after = 3});
  for (int i = 0; i < 3; ++i) model.observe(DeviceTime{i * 1s}, HostTime{100s + i * 1s});
  EXPECT_TRUE(model.to_host(DeviceTime{2s}).settled);
}

TEST(ClockModel, DoesNotMoveForAStalledNetwork) {
  ClockModel model;
  int i = 0;
  for (; i < 100; ++i) model.observe(DeviceTime{i * 332ms}, HostTime{100s + i * 332ms});
  const HostTime before = model.to_host(DeviceTime{i * 332ms}).time;
  const HostTime drained = HostTime{100s + (i + 10) * 332ms};
  for (int k = i; k < i + 10; ++k)
    EXPECT_EQ(model.observe(DeviceTime{k * 332ms}, drained), ClockModel::Observed::Followed);
  EXPECT_LT(std::chrono::abs(model.to_host(DeviceTime{i * 332ms}).time - before), 1us);
}

TEST(ClockModel, RestartsWhenTheDeviceClockGoesBack) {
  ClockModel model;
  for (int i = 0; i < 100; ++i) model.observe(DeviceTime{i * 332ms}, HostTime{100s + i * 332ms});
  EXPECT_EQ(model.observe(DeviceTime{1s}, HostTime{140s}), ClockModel::Observed::Restarted);
  EXPECT_EQ(model.status().restarts, 1u);
  EXPECT_FALSE(model.status().settled);
  EXPECT_LT(std::chrono::abs(model.to_host(DeviceTime{1s}).time - HostTime{140s}), 2ms);
}

TEST(ClockModel, RestartsWhenTheDeviceClockJumpsAhead) {
  ClockModel model;
  for (int i = 0; i < 100; ++i) model.observe(DeviceTime{i * 332ms}, HostTime{100s + i * 332ms});
  EXPECT_EQ(model.observe(DeviceTime{5000s}, HostTime{133200ms}), ClockModel::Observed::Restarted);
  EXPECT_LT(std::chrono::abs(model.to_host(DeviceTime{5000s}).time - HostTime{133200ms}), 2ms);
}

TEST(ClockModel, RestartsWhenTheDeviceClockLosesTimePermanently) {
  ClockModel model;
  int i = 0;
  for (; i < 100; ++i) model.observe(DeviceTime{i * 332ms}, HostTime{100s + i * 332ms});
  bool restarted = false;
  for (; i < 130; ++i) {  // 10 s
    restarted |= model.observe(DeviceTime{i * 332ms - 100ms}, HostTime{100s + i * 332ms}) ==
                 ClockModel::Observed::Restarted;
  }
  EXPECT_TRUE(restarted);
  EXPECT_LT(std::chrono::abs(model.to_host(DeviceTime{i * 332ms - 100ms}).time -
                             HostTime{100s + i * 332ms}),
            2ms);
}

TEST(ClockModel, GoesOnAfterTenMinutesOfSilence) {
  ClockModel model;
  BurstProfile profile(3, {});
  run(profile, model, 120.0);
  const double later_s = 720.0;
  EXPECT_EQ(model.observe(profile.device_at(later_s), profile.host_at(later_s)),
            ClockModel::Observed::Followed);
  EXPECT_LT(
      std::chrono::abs(model.to_host(profile.device_at(later_s)).time - profile.host_at(later_s)),
      2ms);
}

TEST(ClockModel, GivesTheSameResultForTheSameArrivals) {
  ClockModel a;
  ClockModel b;
  BurstProfile one(11, {});
  BurstProfile same(11, {});
  run(one, a, 30.0);
  run(same, b, 30.0);
  EXPECT_EQ(a.to_host(DeviceTime{900s}).time, b.to_host(DeviceTime{900s}).time);
  EXPECT_EQ(a.to_host(DeviceTime{900s}).u_time, b.to_host(DeviceTime{900s}).u_time);
}

TEST(ClockModel, FollowsManyPacketsASecondAsWellAsFew) {
  ClockModel model({.max_constant_delay = 0ns});
  for (int i = 0; i < 30'000; ++i)
    model.observe(DeviceTime{i * 1ms}, HostTime{100s + i * 1ms + (i % 10) * 100us});
  EXPECT_LT(std::chrono::abs(model.to_host(DeviceTime{30s}).time - HostTime{130s}), 20us);
}

}  // namespace
}  // namespace abbe::tests
