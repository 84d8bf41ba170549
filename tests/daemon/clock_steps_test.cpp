#include "abbe/base/clock_steps.hpp"

#include <gtest/gtest.h>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

constexpr ClockReading kFirstReading{.utc = 24h * 365 * 56, .since_boot = 20s};

ClockReading later(std::chrono::nanoseconds by, std::chrono::nanoseconds step) {
  return {.utc = kFirstReading.utc + by + step, .since_boot = kFirstReading.since_boot + by};
}

TEST(ClockSteps, AClockThatRunsOnWasNotSet) {
  ClockSteps steps{kFirstReading};
  EXPECT_FALSE(steps.look(kFirstReading));
  EXPECT_FALSE(steps.look(later(24h * 365, 0s)));
  EXPECT_FALSE(steps.look(later(24h, -1s)));
}

TEST(ClockSteps, AreSeenBothWays) {
  EXPECT_TRUE(ClockSteps{kFirstReading}.look(later(1h, 24h * 365)));
  EXPECT_TRUE(ClockSteps{kFirstReading}.look(later(1h, -10min)));
}

TEST(ClockSteps, AreNotForgottenWhenTheClockIsRightAgain) {
  ClockSteps steps{kFirstReading};
  EXPECT_TRUE(steps.look(later(1h, 24h)));
  EXPECT_TRUE(steps.look(later(2h, 0s)));
}

TEST(ClockSteps, TheClocksOfThisComputerAreRead) {
  const auto now = read_clocks();
  EXPECT_GT(now.utc, now.since_boot);
  EXPECT_GT(now.since_boot, 0s);
}

}  // namespace
}  // namespace abbe::daemon
