#include "abbe/drivers/deadlines.hpp"

#include <gtest/gtest.h>

#include <array>

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

enum class Due { Answer, Repeat, Silence };
using DeadlinesOfThree = Deadlines<Due::Silence>;

constexpr HostTime kStart{1h};

TEST(Deadlines, WithoutADeadlineNothingIsEverDue) {
  const DeadlinesOfThree deadlines;
  EXPECT_EQ(deadlines.next(), DeadlinesOfThree::kNever);
  EXPECT_EQ(deadlines.passed(DeadlinesOfThree::kNever), std::nullopt);
}

TEST(Deadlines, TheEarliestIsNext) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Answer, kStart + 3s);
  deadlines.set(Due::Silence, kStart + 1s);
  EXPECT_EQ(deadlines.next(), kStart + 1s);
}

TEST(Deadlines, IsDueAtItsInstantAndNotBefore) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Repeat, kStart);
  EXPECT_EQ(deadlines.passed(kStart - 1ns), std::nullopt);
  EXPECT_EQ(deadlines.passed(kStart), Due::Repeat);
  EXPECT_EQ(deadlines.passed(kStart + 1h), Due::Repeat) << "until it is set again or cancelled";
}

TEST(Deadlines, SettingAPurposeAgainReplacesItsInstant) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Silence, kStart);
  deadlines.set(Due::Silence, kStart + 1s);
  EXPECT_EQ(deadlines.passed(kStart), std::nullopt);
  EXPECT_EQ(deadlines.next(), kStart + 1s);
}

TEST(Deadlines, ACancelledOneIsNotDue) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Answer, kStart);
  deadlines.set(Due::Repeat, kStart + 1s);
  deadlines.cancel(Due::Answer);
  EXPECT_EQ(deadlines.passed(kStart), std::nullopt);
  EXPECT_EQ(deadlines.next(), kStart + 1s);
  deadlines.cancel_all();
  EXPECT_EQ(deadlines.next(), DeadlinesOfThree::kNever);
}

TEST(Deadlines, OfSeveralPassedOnesTheFirstDeclaredComesFirst) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Silence, kStart);
  deadlines.set(Due::Answer, kStart + 1s);
  EXPECT_EQ(deadlines.passed(kStart), Due::Silence);
  EXPECT_EQ(deadlines.passed(kStart + 1s), Due::Answer) << "although the other one passed earlier";
}

TEST(Deadlines, AWaitingOneIsDueWhenItNoLongerWaits) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Answer, kStart + 1s);
  deadlines.set(Due::Silence, kStart);
  constexpr std::array waiting{Due::Repeat, Due::Silence};

  EXPECT_EQ(deadlines.next(waiting), kStart + 1s);
  EXPECT_EQ(deadlines.passed(kStart, waiting), std::nullopt);
  EXPECT_EQ(deadlines.passed(kStart), Due::Silence);
}

TEST(Deadlines, IsAheadFromSettingToItsInstant) {
  DeadlinesOfThree deadlines;
  EXPECT_FALSE(deadlines.ahead(Due::Answer, kStart));
  deadlines.set(Due::Answer, kStart);
  EXPECT_TRUE(deadlines.ahead(Due::Answer, kStart - 1ns));
  EXPECT_FALSE(deadlines.ahead(Due::Answer, kStart));
  EXPECT_TRUE(deadlines.is_set(Due::Answer));
}

}  // namespace
}  // namespace abbe::drivers
