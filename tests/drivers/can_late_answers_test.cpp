// Whose answer is it: TPDOs carry no SYNC number.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "abbe/protocol/can/error_frame.hpp"
#include "encoder_line.hpp"

namespace abbe::drivers {
namespace {

using namespace encoder_line;
using protocol::SampleFlag;

TEST(EncoderReceiver, AnAnswerStampedBeforeTheSyncIsNotAssignedToIt) {
  Line line;
  line.sync(kStart);
  line.frame(position(1, 7), kStart - 100us);
  line.time(kStart + 900us);
  EXPECT_EQ(line.samples.at(0).missing_mask, 0b111);
  EXPECT_EQ(line.receiver.counters().late_frames, 1u);
}

TEST(EncoderReceiver, AnAxisThatAnswersTwiceInACycleIsInvalid) {
  Line line;
  line.sync(kStart);
  line.frame(position(1, 10), kStart + 10us);
  line.frame(position(1, 20), kStart + 200us);
  line.frame(position(2, 30), kStart + 300us);
  line.frame(position(3, 40), kStart + 400us);
  ASSERT_EQ(line.samples.size(), 1u);
  EXPECT_EQ(line.samples[0].missing_mask, 0b001);
  EXPECT_TRUE(has(line.samples[0].head.flags, SampleFlag::AxisMissing));
  EXPECT_EQ(line.receiver.counters().duplicate_frames, 1u);
}

TEST(EncoderReceiver, ALateAnswerIsNotAssignedToTheNextCycle) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);
  line.frame(position(2, 2001), kStart + 1200us);
  line.frame(position(3, 2002), kStart + 1300us);
  line.time(kStart + 1800us);
  line.sync(kStart + 2ms);
  line.frame(position(2, 3001), kStart + 2200us);
  line.frame(position(3, 3002), kStart + 2300us);
  line.frame(position(1, 2000), kStart + 2400us);  // to the SYNC before
  line.frame(position(1, 3000), kStart + 2500us);

  ASSERT_EQ(line.samples.size(), 3u);
  EXPECT_EQ(line.samples[1].missing_mask, 0b001);
  EXPECT_EQ(line.samples[2].missing_mask, 0b001);
  EXPECT_EQ(line.samples[2].count[1], 3001);
  line.cycle(kStart + 3ms, 4000);
  line.finish();
  EXPECT_EQ(line.samples.back().missing_mask, 0);
  EXPECT_EQ(line.samples.back().count[0], 4000);
}

TEST(EncoderReceiver, ASecondAnswerMarksTheAxisInAHeldSample) {
  Line line;
  line.cycle(kStart, 1000);
  line.cycle(kStart + 3ms, 2000);  // after a pause of the SYNC
  EXPECT_EQ(line.samples.size(), 1u);
  line.frame(position(2, 3001), kStart + 3900us);
  line.cycle(kStart + 4ms, 4000);

  ASSERT_EQ(line.samples.size(), 2u);
  const auto& held = line.samples[1];
  EXPECT_EQ(held.head.time, kStart + 3ms);
  EXPECT_EQ(held.missing_mask, 0b010);
  EXPECT_EQ(held.count[1], 2001);
  EXPECT_EQ(held.head.flags, SampleFlag::AxisMissing | SampleFlag::GapBefore);
  EXPECT_EQ(held.head.lost_before, 2u);
  EXPECT_EQ(line.receiver.counters().samples, 2u);
}

TEST(EncoderReceiver, AHeldSampleLeavesAtTheEndOfItsPeriodWithoutASync) {
  Line line;
  line.cycle(kStart, 1000);
  line.cycle(kStart + 3ms, 2000);
  EXPECT_EQ(line.receiver.deadline(), kStart + 4ms);
  line.time(kStart + 4ms - 1ns);
  EXPECT_EQ(line.samples.size(), 1u);
  line.time(kStart + 4ms);
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples[1].missing_mask, 0);
  EXPECT_EQ(line.receiver.deadline(), HostTime::max());
}

TEST(EncoderReceiver, AHeldSampleLeavesBeforeTheSampleOfABusOff) {
  Line line;
  line.cycle(kStart, 1000);
  line.cycle(kStart + 3ms, 2000);
  line.frame(can::encode_error_frame(
                 {.conditions = static_cast<can::BusConditions>(can::BusCondition::BusOff)}),
             kStart + 3500us);
  ASSERT_EQ(line.samples.size(), 3u);
  EXPECT_EQ(line.samples[1].missing_mask, 0);
  EXPECT_EQ(line.samples[2].missing_mask, 0b111);
}

TEST(EncoderReceiver, ASettledAxisThatAnswersTwiceIsMissingInTheNextSample) {
  Line line;
  line.cycle(kStart, 1000);
  line.frame(position(2, 1501), kStart + 900us);
  line.frame(position(2, 1502), kStart + 950us);
  line.cycle(kStart + 1ms, 2000);
  line.cycle(kStart + 2ms, 3000);
  line.time(kStart + 3ms);

  ASSERT_EQ(line.samples.size(), 3u);
  EXPECT_EQ(line.samples[0].missing_mask, 0);
  EXPECT_EQ(line.samples[1].missing_mask, 0b010);
  EXPECT_EQ(line.samples[2].missing_mask, 0);
}

TEST(EncoderReceiver, OfTwoNodesWithOneIdOnlyOneSampleIsUsed) {
  Line line;
  for (int i = 0; i < 1000; ++i) {
    line.cycle(kStart + 1ms * i, 1000);
    line.frame(position(2, -7), kStart + 1ms * i + 500us);
  }
  const auto used = [](const AxisSample& s) { return (s.missing_mask & 0b010) == 0; };
  EXPECT_EQ(std::ranges::count_if(line.samples, used), 1);
}

TEST(EncoderReceiver, AnAxisIsSettledAfterAHundredRegularCycles) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);  // without an answer
  HostTime sync = kStart + 2ms;
  for (int i = 0; i < 101; ++i, sync += 1ms) {  // the first answers are doubtful
    line.cycle(sync, 2000);
    if (i > 0) {
      EXPECT_NE(line.samples.back().head.time, sync) << i;
    }
  }
  line.cycle(sync, 3000);
  EXPECT_EQ(line.samples.back().head.time, sync);
}

TEST(EncoderReceiver, AnAxisWithoutAnAnswerDelaysNoSample) {
  Line line;
  for (int i = 0; i < 10; ++i) {
    const HostTime sync = kStart + 1ms * i;
    line.sync(sync);
    line.frame(position(1, 1000), sync + 100us);
    line.frame(position(2, 1000), sync + 200us);
    line.time(sync + 800us);
    ASSERT_EQ(line.samples.back().head.time, sync);
  }
}

TEST(EncoderReceiver, AnswersBeforeTheFirstSyncAreNoSamples) {
  Line line;
  for (int i = 0; i < 3; ++i) line.frame(position(1, 1000 + i), kStart + 100us * i);
  EXPECT_TRUE(line.samples.empty());
  line.cycle(kStart + 1ms, 2000);
  ASSERT_EQ(line.samples.size(), 1u);
  EXPECT_EQ(line.samples[0].missing_mask, 0);
}

TEST(EncoderReceiver, AnswersToASyncThatWasNotReceivedMarkNothing) {
  Line line;
  line.cycle(kStart, 1000);
  for (const can::NodeId node : kNodes) line.frame(position(node, 2000), kStart + 1200us);
  EXPECT_EQ(line.samples.size(), 1u);
  line.cycle(kStart + 2ms, 3000);
  line.finish();
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples[1].missing_mask, 0);
  EXPECT_EQ(line.samples[1].head.lost_before, 1u);
}

TEST(EncoderReceiver, TheFirstAnswerAfterAnUnansweredCycleIsAmbiguous) {
  Line line;
  line.cycle(kStart, 1000);
  line.sync(kStart + 1ms);
  line.time(kStart + 1800us);
  line.cycle(kStart + 2ms, 3000);
  EXPECT_EQ(line.samples.back().missing_mask, 0b111);
  line.cycle(kStart + 3ms, 4000);
  line.finish();
  EXPECT_EQ(line.samples.back().missing_mask, 0);
  EXPECT_EQ(line.receiver.counters().missing_answers, 6u);
}

TEST(EncoderReceiver, AnAnswerKnownToBeLateLeavesNoAmbiguity) {
  for (const bool before_the_sync : {true, false}) {
    Line line;
    line.cycle(kStart, 1000);
    line.sync(kStart + 1ms);
    line.frame(position(2, 2001), kStart + 1100us);
    line.frame(position(3, 2002), kStart + 1100us);
    if (before_the_sync) line.frame(position(1, 2000), kStart + 1900us);
    line.sync(kStart + 2ms);
    if (!before_the_sync)
      line.frame(position(1, 2000), kStart + 1900us);  // read late, stamped before
    for (const can::NodeId node : kNodes) line.frame(position(node, 3000), kStart + 2100us);
    line.finish();
    EXPECT_EQ(line.samples.back().missing_mask, 0);
    EXPECT_EQ(line.samples.back().count[0], 3000);
    EXPECT_EQ(line.receiver.counters().late_frames, 1u);
  }
}

TEST(EncoderReceiver, AfterAPauseOrABootUpNoReplyIsOutstanding) {
  for (const bool paused : {true, false}) {
    Line line;
    line.cycle(kStart, 1000);
    line.sync(kStart + 1ms);
    line.time(kStart + 1800us);
    if (!paused) {
      for (const can::NodeId node : kNodes)
        line.frame(can::encode_heartbeat(node, can::NodeState::BootUp), kStart + 1900us);
    }
    line.cycle(paused ? kStart + 5ms : kStart + 2ms, 3000);
    line.finish();
    EXPECT_EQ(line.samples.back().missing_mask, 0);
  }
}

/// Answers of a cycle of 1 ms in the order in which they come.
struct Answer {
  HostTime at;
  can::NodeId node;
  std::int64_t count;
};

TEST(EncoderReceiver, JitterWithinThePeriodCausesNoAmbiguity) {
  Line line;
  std::mt19937 random{7};
  std::uniform_int_distribution<int> sync_us{-80, 80}, answer_us{20, 690};

  for (int i = 0; i < 2000; ++i) {
    const HostTime sync = kStart + 1ms * i + 1us * sync_us(random);
    std::vector<Answer> answers;
    for (const can::NodeId node : kNodes)
      answers.push_back({sync + 1us * answer_us(random), node, i});
    std::ranges::sort(answers, {}, &Answer::at);
    line.sync(sync);
    for (const auto& a : answers) line.frame(position(a.node, a.count), a.at);
  }

  ASSERT_EQ(line.samples.size(), 2000u);
  for (const auto& sample : line.samples) ASSERT_EQ(sample.head.flags, 0u);
}

TEST(EncoderReceiver, DiscardsOldAnswersOfANodeThatIsSometimesLate) {
  constexpr int kCycles = 20'000;
  Line line;
  std::mt19937 random{11};
  std::uniform_int_distribution<int> prompt_us{100, 700}, late_us{750, 1900}, chance{0, 9};
  std::vector<Answer> answers;
  HostTime latest{};

  for (int i = 0, late_in_a_row = 0; i < kCycles; ++i) {
    // Three late ones in a row would be a node that is always late: that cannot be seen.
    late_in_a_row = chance(random) == 0 && late_in_a_row < 2 ? late_in_a_row + 1 : 0;
    const HostTime sync = kStart + 1ms * i;
    latest = std::max(latest + 1us,
                      sync + 1us * (late_in_a_row > 0 ? late_us(random) : prompt_us(random)));
    answers.push_back({latest, 1, i});
    for (const can::NodeId node : {can::NodeId{2}, can::NodeId{3}})
      answers.push_back({sync + 1us * prompt_us(random), node, i});
  }

  std::ranges::stable_sort(answers, {}, &Answer::at);
  std::size_t next = 0;
  for (int i = 0; i < kCycles; ++i) {
    line.sync(kStart + 1ms * i);
    for (; next < answers.size() && answers[next].at < kStart + 1ms * (i + 1); ++next) {
      if (answers[next].at >= line.receiver.deadline()) line.time(line.receiver.deadline());
      line.frame(position(answers[next].node, answers[next].count), answers[next].at);
    }
  }

  std::size_t believed = 0;
  for (std::size_t i = 0; i < line.samples.size(); ++i) {
    const auto& sample = line.samples[i];
    ASSERT_EQ(sample.cycle, i) << "one sample for each cycle";
    if (sample.missing_mask != 0) continue;
    ++believed;
    ASSERT_EQ(sample.count[0], static_cast<std::int64_t>(sample.cycle));
  }

  EXPECT_GT(believed, std::size_t{kCycles} / 2);
}

}  // namespace
}  // namespace abbe::drivers
