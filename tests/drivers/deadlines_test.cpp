#include "abbe/drivers/deadlines.hpp"

#include <gtest/gtest.h>

#include <array>

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

enum class Due { Answer, Repeat, Silence };
using DeadlinesOfThree = Deadlines<Due::Silence>;

constexpr HostTime kQueueStart{1h};

TEST(Deadlines, WithoutADeadlineNothingIsEverDue) {
  const DeadlinesOfThree deadlines;
  EXPECT_EQ(deadlines.next(), DeadlinesOfThree::kNever);
  EXPECT_EQ(deadlines.passed(DeadlinesOfThree::kNever), std::nullopt);
}

TEST(Deadlines, TheEarliestIsNext) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Answer, kQueueStart + 3s);
  deadlines.set(Due::Silence, kQueueStart + 1s);
  EXPECT_EQ(deadlines.next(), kQueueStart + 1s);
}

TEST(Deadlines, IsDueAtItsInstantAndNotBefore) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Repeat, kQueueStart);
  EXPECT_EQ(deadlines.passed(kQueueStart - 1ns), std::nullopt);
  EXPECT_EQ(deadlines.passed(kQueueStart), Due::Repeat);
  EXPECT_EQ(deadlines.passed(kQueueStart + 1h), Due::Repeat)
      << "until it is set again or cancelled";
}

TEST(Deadlines, SettingAPurposeAgainReplacesItsInstant) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Silence, kQueueStart);
  deadlines.set(Due::Silence, kQueueStart + 1s);
  EXPECT_EQ(deadlines.passed(kQueueStart), std::nullopt);
  EXPECT_EQ(deadlines.next(), kQueueStart + 1s);
}

TEST(Deadlines, ACancelledOneIsNotDue) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Answer, kQueueStart);
  deadlines.set(Due::Repeat, kQueueStart + 1s);
  deadlines.cancel(Due::Answer);
  EXPECT_EQ(deadlines.passed(kQueueStart), std::nullopt);
  EXPECT_EQ(deadlines.next(), kQueueStart + 1s);
  deadlines.cancel_all();
  EXPECT_EQ(deadlines.next(), DeadlinesOfThree::kNever);
}

TEST(Deadlines, OfSeveralPassedOnesTheFirstDeclaredComesFirst) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Silence, kQueueStart);
  deadlines.set(Due::Answer, kQueueStart + 1s);
  EXPECT_EQ(deadlines.passed(kQueueStart), Due::Silence);
  EXPECT_EQ(deadlines.passed(kQueueStart + 1s), Due::Answer)
      << "although the other one passed earlier";
}

TEST(Deadlines, AWaitingOneIsDueWhenItNoLongerWaits) {
  DeadlinesOfThree deadlines;
  deadlines.set(Due::Answer, kQueueStart + 1s);
  deadlines.set(Due::Silence, kQueueStart);
  constexpr std::array waiting{Due::Repeat, Due::Silence};

  EXPECT_EQ(deadlines.next(waiting), kQueueStart + 1s);
  EXPECT_EQ(deadlines.passed(kQueueStart, waiting), std::nullopt);
  EXPECT_EQ(deadlines.passed(kQueueStart), Due::Silence);
}

TEST(Deadlines, IsAheadFromSettingToItsInstant) {
  DeadlinesOfThree deadlines;
  EXPECT_FALSE(deadlines.ahead(Due::Answer, kQueueStart));
  deadlines.set(Due::Answer, kQueueStart);
  EXPECT_TRUE(deadlines.ahead(Due::Answer, kQueueStart - 1ns));
  EXPECT_FALSE(deadlines.ahead(Due::Answer, kQueueStart));
  EXPECT_TRUE(deadlines.is_set(Due::Answer));
}

}  // namespace
}  // namespace abbe::drivers
