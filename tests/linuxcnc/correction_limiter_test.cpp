// SPDX-License-Identifier: GPL-2.0-or-later
// Limits of the correction in the realtime component for LinuxCNC (linuxcnc/realtime).
#include "correction_limiter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

namespace {

constexpr double kPeriod_s = 1e-3;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr abbe_limits kLimits{ABBE_DEFAULT_CLAMP, ABBE_DEFAULT_RATE, ABBE_DEFAULT_ACCELERATION};
constexpr double kMostPerCycle = ABBE_DEFAULT_RATE * kPeriod_s;
constexpr double kMostChange = ABBE_DEFAULT_ACCELERATION * kPeriod_s * kPeriod_s;
constexpr double kRounding = 1e-12;

/// Largest value, step and change of step of one axis over all moves.
class Watched {
 public:
  void move(double target) {
    abbe_limiter_move(&axis_, target, &kLimits, kPeriod_s);
    record();
  }
  void hold() {
    abbe_limiter_hold(&axis_, &kLimits, kPeriod_s);
    record();
  }
  [[nodiscard]] double value() const { return axis_.value; }
  void expect_within_limits() const {
    EXPECT_LE(largest_value_, ABBE_DEFAULT_CLAMP + kRounding);
    EXPECT_LE(largest_step_, kMostPerCycle + kRounding);
    EXPECT_LE(largest_change_, kMostChange + kRounding);
  }

 private:
  void record() {
    const double step = axis_.value - value_before_;
    largest_value_ = std::max(largest_value_, std::abs(axis_.value));
    largest_step_ = std::max(largest_step_, std::abs(step));
    largest_change_ = std::max(largest_change_, std::abs(step - step_before_));
    value_before_ = axis_.value;
    step_before_ = step;
  }
  abbe_limiter axis_{};
  double value_before_ = 0.0, step_before_ = 0.0;
  double largest_value_ = 0.0, largest_step_ = 0.0, largest_change_ = 0.0;
};

TEST(CorrectionLimiter, ReachesEveryTargetWithoutOvershoot) {
  for (const double target : {1e-7, 2e-4, 3.3e-4, 0.01, 0.042, 0.2, -0.117}) {
    Watched axis;
    double largest = 0.0;
    for (int i = 0; i < 1000; ++i) {
      axis.move(target);
      largest = std::max(largest, axis.value() * (target < 0.0 ? -1.0 : 1.0));
    }
    EXPECT_NEAR(axis.value(), target, kRounding);
    EXPECT_LE(largest, std::abs(target) + kRounding);
    axis.expect_within_limits();
  }
}

TEST(CorrectionLimiter, FadesInTheTimeOfTheLimits) {
  Watched axis;
  for (int i = 0; i < 1000; ++i) axis.move(0.1);
  int cycles = 0;
  while (std::abs(axis.value()) > 1e-9 && cycles < 1000) axis.move(0.0), ++cycles;

  // Trapezoid: distance / rate + rate / acceleration.
  const double trapezoid_s =
      0.1 / ABBE_DEFAULT_RATE + ABBE_DEFAULT_RATE / ABBE_DEFAULT_ACCELERATION;
  EXPECT_NEAR(cycles * kPeriod_s, trapezoid_s, 2.0 * kPeriod_s);
  axis.expect_within_limits();
}

TEST(CorrectionLimiter, FollowsASlowCorrectionWithoutLag) {
  Watched axis;
  for (int i = 0; i < 2000; ++i) {
    const double target = 0.04 * std::sin(2.0 * M_PI * i * kPeriod_s);  // at most 0.25 mm/s
    axis.move(target);
    if (i > 10) {
      EXPECT_NEAR(axis.value(), target, 2.0 * kMostChange) << i;
    }
  }
  axis.expect_within_limits();
}

TEST(CorrectionLimiter, NeverLeavesTheLimitsWhateverTheTargets) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> wide(-1.0, 1.0);
  const std::array<double, 5> odd{kNaN, kInfinity, -kInfinity, 1e300, 0.0};
  Watched axis;
  for (int i = 0; i < 200'000; ++i) {
    const auto kind = random() % 100;
    if (kind < 5)
      axis.move(odd.at(random() % odd.size()));
    else if (kind < 10)
      axis.hold();
    else
      axis.move(kind < 50 ? std::copysign(1.0, wide(random)) : wide(random));
  }
  axis.expect_within_limits();
}

TEST(CorrectionLimiter, ATargetThatIsNotFiniteIsZero) {
  for (const double target : {kNaN, kInfinity, -kInfinity}) {
    Watched axis;
    for (int i = 0; i < 200; ++i) axis.move(0.05);
    for (int i = 0; i < 200; ++i) axis.move(target);
    EXPECT_NEAR(axis.value(), 0.0, kRounding);
    axis.expect_within_limits();
  }
}

TEST(CorrectionLimiter, HoldStopsWithinTheAccelerationAndKeepsTheValue) {
  Watched axis;
  for (int i = 0; i < 30; ++i) axis.move(0.2);
  for (int i = 0; i < 20; ++i) axis.hold();
  const double held = axis.value();
  for (int i = 0; i < 100; ++i) axis.hold();
  EXPECT_EQ(axis.value(), held);
  EXPECT_GT(held, 0.0);
  axis.expect_within_limits();
}

TEST(CorrectionLimiter, UnusableLimitsAreReplacedByTheDefaults) {
  for (const double limit : {kNaN, kInfinity, 0.0, -1.0}) {
    const abbe_limits unusable{limit, limit, limit};
    abbe_limiter axis{}, reference{};
    for (int i = 0; i < 300; ++i) {
      abbe_limiter_move(&axis, 5.0, &unusable, kPeriod_s);
      abbe_limiter_move(&reference, 5.0, &kLimits, kPeriod_s);
    }
    EXPECT_EQ(axis.value, reference.value);
  }
}

/// Cycles of the supervisor with a feeder that counts, or not.
class Supervised {
 public:
  abbe_inputs in{true, true, true, true, 0, ABBE_DEFAULT_TIMEOUT};
  abbe_mode cycle(bool counts) {
    if (counts) ++in.sequence;
    return abbe_supervise(&state_, &in, kPeriod_s);
  }
  abbe_mode cycles(int n, bool counts) {
    abbe_mode mode = ABBE_FADE;
    for (int i = 0; i < n; ++i) mode = cycle(counts);
    return mode;
  }
  /// Off and on again while the feeder counts.
  abbe_mode switch_on() {
    in.enable = false;
    cycles(2, true);
    in.enable = true;
    return cycle(true);
  }
  [[nodiscard]] bool stale() const { return state_.stale; }

 private:
  abbe_supervisor state_{};
};

constexpr int kTimeoutCycles = static_cast<int>(ABBE_DEFAULT_TIMEOUT / kPeriod_s);

TEST(CorrectionSupervisor, FollowsOnlyWhenEverythingIsRight) {
  Supervised s;
  EXPECT_EQ(s.switch_on(), ABBE_FOLLOW);
  for (bool abbe_inputs::*input : {&abbe_inputs::homed, &abbe_inputs::valid}) {
    s.in.*input = false;
    EXPECT_EQ(s.cycle(true), ABBE_FADE);
    s.in.*input = true;
    EXPECT_EQ(s.cycle(true), ABBE_FOLLOW);
  }
  s.in.machine_on = false;
  EXPECT_EQ(s.cycle(true), ABBE_HOLD);
  s.in.machine_on = true;
  EXPECT_EQ(s.cycle(true), ABBE_FOLLOW);
  s.in.enable = false;
  EXPECT_EQ(s.cycle(true), ABBE_FADE);
}

TEST(CorrectionSupervisor, AStaleFeederLatchesUntilSwitchedOnAgain) {
  Supervised s;
  s.switch_on();
  EXPECT_EQ(s.cycles(kTimeoutCycles - 1, false), ABBE_FOLLOW);
  EXPECT_EQ(s.cycles(3, false), ABBE_FADE);
  EXPECT_TRUE(s.stale());
  EXPECT_EQ(s.cycles(1000, true), ABBE_FADE) << "a feeder that returns does not switch on";
  EXPECT_EQ(s.switch_on(), ABBE_FOLLOW);
  EXPECT_FALSE(s.stale());
}

TEST(CorrectionSupervisor, SwitchingOnWithoutALivingFeederStaysStale) {
  Supervised s;
  s.in.sequence = 4711;  // left in HAL by a feeder that was killed
  EXPECT_EQ(s.cycles(10, false), ABBE_FADE);
  s.in.enable = false;
  s.cycles(10, false);
  s.in.enable = true;
  EXPECT_EQ(s.cycle(false), ABBE_FADE);
  EXPECT_TRUE(s.stale());
}

TEST(CorrectionSupervisor, AFeederThatDiesWhileTheMachineIsOffIsStaleAfterwards) {
  Supervised s;
  s.switch_on();
  s.in.machine_on = false;
  EXPECT_EQ(s.cycles(2 * kTimeoutCycles, false), ABBE_HOLD);
  s.in.machine_on = true;
  EXPECT_EQ(s.cycles(10, true), ABBE_FADE);
}

TEST(CorrectionSupervisor, TheSequenceNumberMayWrapAround) {
  Supervised s;
  s.in.sequence = std::numeric_limits<std::uint32_t>::max() - 5;
  s.switch_on();
  EXPECT_EQ(s.cycles(20, true), ABBE_FOLLOW);
}

}  // namespace
