// Faults, outages and delayed hosts: what the counter card driver keeps, and what it reports as
// lost. Against the simulated card, over a real USB/IP connection in stepped time.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "counter_card_peer.hpp"

namespace abbe::tests {
namespace {

using protocol::SampleFlag;
using testing::HasSubstr;

TEST(CounterCardOutage, RecoversFromAnOverrunKeepsPositionsAndMarksTheGap) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  bench.take_samples();
  bench.server.card().overrun();

  ASSERT_TRUE(bench.until([&] { return bench.device->status().gaps != 0; }));
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("overrun"));
  bench.cycles_for(50ms);
  const auto samples = bench.take_samples();
  const auto gap = std::ranges::find_if(
      samples, [](const auto& s) { return has(s.head.flags, SampleFlag::GapBefore); });
  ASSERT_NE(gap, samples.end());
  ASSERT_NE(gap, samples.begin());
  const auto& before = *std::prev(gap);
  EXPECT_EQ(gap->cycle - before.cycle - 1, gap->head.lost_before);
  const double seconds = std::chrono::duration<double>(gap->head.time - before.head.time).count();
  EXPECT_NEAR(gap->position[0] - before.position[0], kSpeed_m_per_s * seconds, 1e-6);
  EXPECT_EQ(bench.device->status().faults, 1u);
}

/// Where X is by the truth, from a sample on: positions of one origin.
void expect_the_same_zero(const protocol::AxisSample& before, const protocol::AxisSample& after) {
  const double seconds = std::chrono::duration<double>(after.head.time - before.head.time).count();
  EXPECT_NEAR(after.position[0] - before.position[0], kSpeed_m_per_s * seconds, 1e-4);
}

bool any_restarted(const std::vector<protocol::AxisSample>& samples) {
  return std::ranges::any_of(
      samples, [](const auto& s) { return has(s.head.flags, SampleFlag::Restarted); });
}

TEST(CounterCardOutage, OneFailedRequestIsSentAgainAndNothingIsLost) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  bench.take_samples();
  bench.server.inject({.kind = sim::FaultKind::FailRequest}, bench.time.now());
  bench.cycles_for(500ms);
  const auto samples = bench.take_samples();
  for (std::size_t i = 1; i < samples.size(); ++i)
    ASSERT_EQ(samples[i].cycle, samples[i - 1].cycle + 1);
  EXPECT_FALSE(any_restarted(samples));
  EXPECT_EQ(bench.device->status().faults, 0u);
}

TEST(CounterCardOutage, RequestsThatFailRepeatedlyResetNoCounter) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  const auto before = bench.take_samples().back();
  bench.server.inject({.kind = sim::FaultKind::FailRequest, .value = 3}, bench.time.now());
  ASSERT_TRUE(bench.until([&] { return bench.device->status().state == "closed"; }));
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("status: it cannot be read"));
  ASSERT_TRUE(bench.until([&] { return bench.device->status().gaps != 0; }));
  bench.cycles_for(50ms);
  const auto samples = bench.take_samples();
  EXPECT_FALSE(any_restarted(samples));
  expect_the_same_zero(before, samples.back());
}

TEST(CounterCardOutage, CountsGoOnAfterALostConnectionAndTheGapIsMarked) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  const auto before = bench.take_samples().back();
  bench.server.inject({.kind = sim::FaultKind::Disconnect}, bench.time.now());
  ASSERT_TRUE(bench.until([&] { return bench.device->status().gaps != 0; }));
  bench.cycles_for(50ms);
  const auto samples = bench.take_samples();
  EXPECT_FALSE(any_restarted(samples));
  EXPECT_GT(samples.front().head.lost_before, 100u);
  expect_the_same_zero(before, samples.back());
}

TEST(CounterCardOutage, AClockThatWrappedDuringTheOutageIsTakenAsContinuous) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  bench.take_samples();
  const auto before = bench.keeper.scans.back();
  bench.server.disconnect();  // the card keeps its power
  bench.cycles_for(10ms);
  bench.time.advance(2h);  // 7.2e9 counts of the clock

  ASSERT_TRUE(bench.until([&] { return bench.device->status().gaps != 0; }))
      << bench.device->status().state << ": " << bench.device->status().last_fault;
  const auto& after = bench.keeper.scans.back();
  EXPECT_FALSE(any_restarted(bench.take_samples()));
  EXPECT_GT(after.clock_count - before.clock_count, static_cast<std::int64_t>(7200 * kClock_hz));
  EXPECT_EQ(after.axes.count[1], before.axes.count[1]);
}

TEST(CounterCardOutage, CountsRestartAfterAPowerFailureOfTheCard) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  bench.take_samples();
  bench.server.inject({.kind = sim::FaultKind::CardRestart}, bench.time.now());
  const auto counted = bench.device->status().samples;

  ASSERT_TRUE(bench.until([&] { return bench.device->status().samples > counted; }));
  bench.cycles_for(50ms);
  const auto samples = bench.take_samples();
  const auto first = std::ranges::find_if(
      samples, [](const auto& s) { return has(s.head.flags, SampleFlag::Restarted); });
  ASSERT_NE(first, samples.end());
  EXPECT_LT(first->position[0], 2e-3) << "from where it was set up, 50 ms before the first scan";
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("did not continue"));
}

TEST(CounterCardOutage, AnUnexpectedClockValueMeansThatTheCardRestarted) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  bench.take_samples();
  bench.server.card().jump_clock(static_cast<std::int64_t>(10 * kClock_hz));
  bench.server.inject({.kind = sim::FaultKind::Disconnect}, bench.time.now());
  const auto counted = bench.device->status().samples;
  ASSERT_TRUE(bench.until([&] { return bench.device->status().samples > counted; }));
  EXPECT_TRUE(any_restarted(bench.take_samples()));
}

TEST(CounterCardOutage, DetectsASilentCardWithinItsTimeOutAlsoWhileItsStatusIsAwaited) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  for (const auto phase : {0ms, 30ms, 60ms, 90ms}) {  // of the status question
    bench.cycles_for(500ms + phase);
    const auto before = bench.device->status().faults;
    bench.server.inject({.kind = sim::FaultKind::Mute, .duration_s = 0.2}, bench.time.now());
    EXPECT_TRUE(bench.until([&] { return bench.device->status().faults > before; },
                            drivers::CounterCardSessionOptions{}.silence + 4 * CardBench::kCycle));
    EXPECT_THAT(bench.device->status().last_fault, HasSubstr("no scans for 90 ms"));
    ASSERT_TRUE(bench.until([&] { return bench.device->status().state == "streaming"; }));
  }
}

TEST(CounterCardOutage, AHostDelayedForLongerThanTheTimeOutLosesNoScan) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  for (const auto phase : {0ms, 30ms, 60ms, 90ms}) {  // of the status question
    bench.cycles_for(200ms + phase);
    bench.time.advance(110ms);
    bench.cycles_for(50ms);
  }
  EXPECT_EQ(bench.device->status().faults, 0u) << bench.device->status().last_fault;
  EXPECT_EQ(bench.device->status().gaps, 0u);
}

/// Runs cycles until a request is sent whose answer is not yet read.
void cycle_until_asked(CardBench& bench) {
  std::array<protocol::RawBlock, 64> blocks;
  const auto asked = [&] {
    bool any = false;
    while (const auto n = bench.device->raw().pop(blocks)) {
      for (std::size_t i = 0; i < n; ++i)
        any = any || blocks[i].direction == protocol::RawBlock::Direction::ToDevice;
    }
    return any;
  };

  (void)asked();
  ASSERT_TRUE(bench.until([&] {
    bench.cycle();
    return asked();
  }));
}

TEST(CounterCardOutage, AHostDelayedWhileTheStatusIsAwaitedReadsTheAnswerFirst) {
  auto card = simulated_card();
  card.fifo_bytes = std::size_t{1024} * 1024;  // no overrun in 0.6 s
  CardBench bench{CardBench::default_options(), card};
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  cycle_until_asked(bench);
  bench.time.advance(600ms);
  bench.cycles_for(200ms);
  EXPECT_EQ(bench.device->status().faults, 0u) << bench.device->status().last_fault;
  EXPECT_EQ(bench.device->status().gaps, 0u);
}

TEST(CounterCardOutage, AHostDelayedUntilTheCardOverranKeepsTheZero) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  const auto before = bench.take_samples().back();
  bench.time.advance(1500ms);
  ASSERT_TRUE(bench.until([&] { return bench.device->status().gaps != 0; }));
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("overrun"));
  bench.cycles_for(50ms);
  const auto samples = bench.take_samples();
  EXPECT_FALSE(any_restarted(samples));
  expect_the_same_zero(before, samples.back());
  EXPECT_EQ(bench.device->receiver().counters().restarted, 0u);
}

TEST(CounterCardOutage, BytesTornOnceAfterTheCardWasReopenedResetNothing) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(50ms);
  const auto before = bench.take_samples().back();
  bench.server.inject({.kind = sim::FaultKind::Disconnect}, bench.time.now());

  ASSERT_TRUE(bench.until([&] { return bench.device->status().state == "arming"; }));
  bench.server.card().tear(4);  // the latch, which stands, where the clock should be
  ASSERT_TRUE(bench.until([&] { return bench.device->status().gaps != 0; }));
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("out of step"));
  bench.cycles_for(50ms);
  const auto samples = bench.take_samples();
  EXPECT_FALSE(any_restarted(samples));
  expect_the_same_zero(before, samples.back());
}

TEST(CounterCardOutage, MarksScansThatTheCardLost) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(20ms);
  bench.server.card().lose_scans(13);
  bench.cycles_for(20ms);
  EXPECT_EQ(bench.device->receiver().counters().lost_scans, 13u);
  EXPECT_EQ(bench.device->status().gaps, 1u);
}

}  // namespace
}  // namespace abbe::tests
