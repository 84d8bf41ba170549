#include "abbe/base/clock_steps.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/base/wall_clock.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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

TEST(ClockChange, IsASetClockOrASuspendedComputer) {
  const ClockReading first{.utc = 24h * 365 * 56, .since_boot = 20s, .running = 20s};
  const auto after = [&first](std::chrono::nanoseconds step, std::chrono::nanoseconds suspended) {
    return change_between(first, {.utc = first.utc + 1h + step + suspended,
                                  .since_boot = first.since_boot + 1h + suspended,
                                  .running = first.running + 1h});
  };
  EXPECT_THAT(in_words(after(0s, 0s), "abbed started"), IsEmpty());
  EXPECT_THAT(in_words(after(-1999ms, 1999ms), "abbed started"), IsEmpty());
  EXPECT_THAT(in_words(after(24h * 200 + 3h, 0s), "abbed started"),
              ElementsAre(HasSubstr("was set forward by 200 d 3 h since abbed started")));
  EXPECT_THAT(in_words(after(-5min - 2s, 0s), "abbed started"),
              ElementsAre(HasSubstr("was set backward by 5 min 2 s since")));
  EXPECT_THAT(in_words(after(3s, 2h), "abbed started"),
              ElementsAre(HasSubstr("forward by 3 s"), HasSubstr("suspended for 2 h 0 min")));
}

TEST(WallClock, DatesSamplesByTheClockAsItIsNow) {
  ClockReading now{.utc = 24h * 365 * 56, .since_boot = 20s, .running = 20s};
  const WallClock clock{[&now] { return now; }};
  const protocol::HostTime host{20s};
  EXPECT_EQ(clock.offset(host).to_utc(host), clock.now());
  now.utc += 24h * 200;
  const WallClock copy = clock;
  EXPECT_EQ(copy.now(), protocol::UtcTime{now.utc});
  EXPECT_EQ(copy.offset(host).to_utc(host - 5s), clock.now() - 5s);
  EXPECT_EQ(copy.since_start().step, 24h * 200);
}

TEST(ClockSteps, TheClocksOfThisComputerAreRead) {
  const auto now = read_clocks();
  EXPECT_GT(now.utc, now.since_boot);
  EXPECT_GT(now.since_boot, 0s);
  EXPECT_GE(now.since_boot, now.running);
}

}  // namespace
}  // namespace abbe::daemon
