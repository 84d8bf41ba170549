// SPDX-License-Identifier: GPL-2.0-or-later
// Limits of the correction in the realtime component for LinuxCNC (linuxcnc/realtime).
#include "correction_limiter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

namespace {

constexpr double kPeriod_s = 1e-3;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr abbe_limits kLimits{ABBE_DEFAULT_CLAMP, ABBE_DEFAULT_RATE, ABBE_DEFAULT_ACCELERATION};
constexpr double kMostPerCycle = ABBE_DEFAULT_RATE * kPeriod_s;
constexpr double kMostChange = ABBE_DEFAULT_ACCELERATION * kPeriod_s * kPeriod_s;
constexpr double kRounding = 1e-12;

/// Largest value, step and change of step of one axis.
class Largest {
 public:
  void record(double value) {
    const double step = value - value_before_;
    value_ = std::max(value_, std::abs(value));
    step_ = std::max(step_, std::abs(step));
    change_ = std::max(change_, std::abs(step - step_before_));
    value_before_ = value;
    step_before_ = step;
  }
  void expect_within_limits() const {
    EXPECT_LE(value_, ABBE_DEFAULT_CLAMP + kRounding);
    EXPECT_LE(step_, kMostPerCycle + kRounding);
    EXPECT_LE(change_, kMostChange + kRounding);
  }

 private:
  double value_before_ = 0.0, step_before_ = 0.0;
  double value_ = 0.0, step_ = 0.0, change_ = 0.0;
};

/// One axis that moves alone.
class Watched {
 public:
  void move(double target) {
    abbe_limiter_move(&axis_, &target, 1, &kLimits, kPeriod_s);
    record();
  }
  void hold() {
    abbe_limiter_hold(&axis_, &kLimits, kPeriod_s);
    record();
  }
  [[nodiscard]] double value() const { return axis_.value; }
  void expect_within_limits() const { largest_.expect_within_limits(); }

 private:
  void record() { largest_.record(axis_.value); }
  abbe_limiter axis_{};
  Largest largest_;
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
      const double target = 0.15;
      abbe_limiter_move(&axis, &target, 1, &unusable, kPeriod_s);
      abbe_limiter_move(&reference, &target, 1, &kLimits, kPeriod_s);
    }
    EXPECT_EQ(axis.value, reference.value);
  }
}

TEST(CorrectionLimiter, AllAxesHaveTheSameFractionOfTheirWay) {
  std::array<abbe_limiter, 3> axes{};
  const std::array<double, 3> target{0.04, -0.005, 0.017}, nothing{};
  for (const auto& to : {target, nothing}) {
    for (int i = 0; i < 100; ++i) {
      abbe_limiter_move(axes.data(), to.data(), 3, &kLimits, kPeriod_s);
      const double fraction = axes[0].value / target[0];
      for (std::size_t k = 1; k < 3; ++k)
        EXPECT_NEAR(axes.at(k).value, fraction * target.at(k), kRounding) << i;
    }
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(axes.at(k).value, to.at(k), kRounding);
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

/// Three axes with a feeder that counts, switched on.
class Corrected {
 public:
  Corrected() {
    in_.enable = false;
    cycle({0.0, 0.0, 0.0});
    cycle({0.0, 0.0, 0.0});
    in_.enable = true;
  }
  using Vector = std::array<double, 3>;
  void cycle(const Vector& wanted) {
    ++in_.sequence;
    abbe_correct(&state_, &in_, wanted.data(), 3, &kLimits, kPeriod_s);
    for (std::size_t i = 0; i < 3; ++i) largest_.at(i).record(value(i));
  }
  void cycles(int n, const Vector& wanted) {
    for (int i = 0; i < n; ++i) cycle(wanted);
  }
  [[nodiscard]] double value(std::size_t axis) const { return state_.axes[axis].value; }
  [[nodiscard]] bool active() const { return state_.active; }
  [[nodiscard]] abbe_loss loss() const { return state_.loss; }
  void expect_within_limits() const {
    for (const Largest& axis : largest_) axis.expect_within_limits();
  }
  abbe_inputs in_{true, true, true, true, 0, ABBE_DEFAULT_TIMEOUT};

 private:
  abbe_corrector state_{};
  std::array<Largest, 3> largest_;
};

constexpr Corrected::Vector kWanted{0.04, -0.02, 0.01};

TEST(Correction, IsActiveOnceTheWholeVectorIsApplied) {
  Corrected c;
  for (int i = 0; i < 1000 && !c.active(); ++i) {
    EXPECT_EQ(c.loss(), i == 0 ? ABBE_NOT_LOST : ABBE_LOST_LIMITED);
    c.cycle(kWanted);
  }
  EXPECT_TRUE(c.active());
  EXPECT_EQ(c.loss(), ABBE_NOT_LOST);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(c.value(i), kWanted.at(i), ABBE_REACHED);
}

/// One component that may not be applied takes the whole vector away, along its direction.
TEST(Correction, NothingIsAppliedInPart) {
  const std::array<std::pair<double, abbe_loss>, 5> spoilt{
      {{ABBE_DEFAULT_CLAMP * 1.001, ABBE_LOST_CLAMP},
       {-1e300, ABBE_LOST_CLAMP},
       {kNaN, ABBE_LOST_NOT_A_NUMBER},
       {kInfinity, ABBE_LOST_NOT_A_NUMBER},
       {-kInfinity, ABBE_LOST_NOT_A_NUMBER}}};
  for (const auto& [component, loss] : spoilt) {
    Corrected c;
    c.cycles(200, kWanted);
    ASSERT_TRUE(c.active());
    for (int i = 0; i < 200; ++i) {
      c.cycle({kWanted[0], component, kWanted[2]});
      EXPECT_FALSE(c.active());
      EXPECT_EQ(c.loss(), loss);
      EXPECT_NEAR(c.value(0) / kWanted[0], c.value(2) / kWanted[2], 1e-9) << component;
      EXPECT_NEAR(c.value(0) / kWanted[0], c.value(1) / kWanted[1], 1e-9) << component;
    }
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(c.value(i), 0.0, kRounding);
    c.cycles(200, kWanted);
    EXPECT_TRUE(c.active());
    c.expect_within_limits();
  }
}

TEST(Correction, AVectorThatChangesFasterThanTheRateIsNotActive) {
  Corrected c;
  c.cycles(200, {-0.15, 0.01, 0.0});
  ASSERT_TRUE(c.active());
  const double twice_the_rate = 2.0 * kMostPerCycle;
  for (int i = 1; i <= 60; ++i) c.cycle({-0.15 + twice_the_rate * i, 0.01, 0.0});
  EXPECT_FALSE(c.active());
  EXPECT_EQ(c.loss(), ABBE_LOST_LIMITED);
  c.cycles(100, {-0.15 + twice_the_rate * 60, 0.01, 0.0});
  EXPECT_TRUE(c.active());
  c.expect_within_limits();
}

TEST(Correction, AVectorThatChangesAsAPathDoesStaysActive) {
  Corrected c;
  c.cycles(200, {0.04, 0.0, 0.0});
  for (int i = 0; i < 3000; ++i) {
    const double angle = 2.0 * M_PI * i * kPeriod_s;  // at most 0.25 mm/s
    c.cycle({0.04 * std::cos(angle), 0.04 * std::sin(angle), 0.0});
    EXPECT_TRUE(c.active()) << i;
  }
  c.expect_within_limits();
}

TEST(Correction, ALossIsKnownForWhatTheUserSwitchedOn) {
  Corrected c;
  c.cycles(200, kWanted);
  for (bool abbe_inputs::*input : {&abbe_inputs::homed, &abbe_inputs::machine_on}) {
    c.in_.*input = false;
    c.cycle(kWanted);
    EXPECT_EQ(c.loss(), ABBE_NOT_LOST);
    c.in_.*input = true;
    c.cycles(200, kWanted);
  }
  c.in_.valid = false;
  c.cycle(kWanted);
  EXPECT_EQ(c.loss(), ABBE_LOST_REFUSED);
  c.in_.enable = false;
  c.cycle(kWanted);
  EXPECT_EQ(c.loss(), ABBE_NOT_LOST);
}

TEST(Correction, NeverLeavesTheLimitsWhateverIsWanted) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> wide(-1.5 * ABBE_DEFAULT_CLAMP, 1.5 * ABBE_DEFAULT_CLAMP);
  const std::array<double, 5> odd{kNaN, kInfinity, -kInfinity, 1e300, 0.0};
  Corrected c;
  Corrected::Vector wanted{};
  for (int i = 0; i < 200'000; ++i) {
    if (random() % 20 == 0)
      for (double& component : wanted) component = wide(random);
    if (random() % 200 == 0) wanted.at(random() % 3) = odd.at(random() % odd.size());
    c.in_.machine_on = random() % 50 != 0;
    c.in_.valid = random() % 30 != 0;
    c.cycle(wanted);
  }
  c.expect_within_limits();
}

}  // namespace
