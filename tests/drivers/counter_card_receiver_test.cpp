#include <gtest/gtest.h>

#include <vector>

#include "abbe/drivers/counter_card/receiver.hpp"
#include "counter_card_peer.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using protocol::SampleFlag;

constexpr std::uint32_t kCountsPerScan = 25;  // 1 MHz, 40 kHz

/// Scans of the wiring X, Y, clock, latch as the card sends them.
class Card {
 public:
  std::vector<std::byte> scans(std::size_t n) {
    std::vector<std::byte> bytes;
    for (std::size_t i = 0; i < n; ++i) {
      clock_ += kCountsPerScan;
      for (const std::uint32_t value : {x, y, clock_, latch}) put(bytes, value);
      x += x_step;
    }
    return bytes;
  }
  void lose(std::size_t n) { clock_ += static_cast<std::uint32_t>(n) * kCountsPerScan; }
  [[nodiscard]] std::uint32_t clock() const { return clock_; }
  std::uint32_t x = 0, y = 0, latch = 0;
  std::uint32_t x_step = 0;

 private:
  static void put(std::vector<std::byte>& bytes, std::uint32_t value) {
    for (int shift = 0; shift < 32; shift += 8)
      bytes.push_back(static_cast<std::byte>(value >> shift));
  }
  std::uint32_t clock_ = 1000;
};

class CounterCardReceiverTest : public testing::Test {
 protected:
  void start() {
    for (const auto& write : quad08::channel_writes(0, {}, {}, {})) receiver_.on_control(write);
    begin_stream();
  }
  void begin_stream() {
    receiver_.on_control(quad08::write(quad08::Register::DmaControl, quad08::dma::kChannel1On));
  }
  void reopen() {
    receiver_.on_control(quad08::read_firmware_version());
    begin_stream();
  }
  std::vector<CounterScan> push(std::span<const std::byte> bytes) {
    std::vector<CounterScan> all;
    now_ += 1ms;
    receiver_.push(bytes, now_);
    for (auto scans = receiver_.next(); !scans.empty(); scans = receiver_.next())
      all.insert(all.end(), scans.begin(), scans.end());
    return all;
  }

  CounterCardReceiverOptions options() {
    CounterCardReceiverOptions o;
    o.wiring = tests::card_wiring();
    return o;
  }
  CounterCardReceiver receiver_{options()};
  Card card_;
  HostTime now_{1h};
};

TEST_F(CounterCardReceiverTest, GivesEveryScanInSi) {
  start();
  card_.x = 500;
  const auto scans = push(card_.scans(10));
  ASSERT_EQ(scans.size(), 10u);
  EXPECT_EQ(scans[3].axes.count[0], 500);
  EXPECT_DOUBLE_EQ(scans[3].axes.position[0], 500e-8);
  EXPECT_EQ(scans[3].clock_count, 1100);
  EXPECT_EQ(scans[9].axes.cycle, 9u);
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::Restarted));
  EXPECT_EQ(receiver_.counters().gaps, 0u);
}

TEST_F(CounterCardReceiverTest, StampsScansByTheClockChannel) {
  start();
  const auto scans = push(card_.scans(40));
  for (std::size_t i = 1; i < scans.size(); ++i)
    EXPECT_EQ(scans[i].axes.head.time - scans[i - 1].axes.head.time, 25us);
  EXPECT_LT(scans.back().axes.head.time, now_);
  EXPECT_GT(scans.back().axes.head.time, now_ - 2ms);
}

TEST_F(CounterCardReceiverTest, UnwrapsPositionsTo64Bit) {
  start();
  card_.x_step = 0x10000000;
  std::vector<CounterScan> scans;
  for (int i = 0; i < 10; ++i) scans = push(card_.scans(10));
  EXPECT_EQ(scans.back().axes.count[0], std::int64_t{99} * 0x10000000);
  card_.x_step = 0xF0000000;  // back
  for (int i = 0; i < 10; ++i) scans = push(card_.scans(10));
  EXPECT_EQ(scans.back().axes.count[0], std::int64_t{100 - 99} * 0x10000000);
}

TEST_F(CounterCardReceiverTest, MarksAndCountsLostScansByTheClock) {
  start();
  push(card_.scans(10));
  card_.lose(7);
  const auto scans = push(card_.scans(10));
  ASSERT_EQ(scans.size(), 10u);
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::GapBefore));
  EXPECT_EQ(scans[0].axes.head.lost_before, 7u);
  EXPECT_EQ(scans[0].axes.cycle, 17u);
  EXPECT_FALSE(has(scans[1].axes.head.flags, SampleFlag::GapBefore));
  EXPECT_EQ(receiver_.counters().lost_scans, 7u);
}

TEST_F(CounterCardReceiverTest, GivesNoScansFromOtherBytes) {
  start();
  push(card_.scans(10));
  std::vector<std::byte> garbage(16 * 20);
  for (std::size_t i = 0; i < garbage.size(); ++i)
    garbage[i] = static_cast<std::byte>(i * 37 % 251);
  EXPECT_TRUE(push(garbage).empty());
  EXPECT_TRUE(receiver_.out_of_step());
  EXPECT_GE(receiver_.counters().refused_scans, CounterCardReceiver::kMostRefused);
}

TEST_F(CounterCardReceiverTest, GoesOnAfterAScanThatWasTornOnce) {
  start();
  push(card_.scans(10));
  std::vector<std::byte> odd(16, std::byte{0x77});
  EXPECT_TRUE(push(odd).empty());
  const auto scans = push(card_.scans(10));
  ASSERT_EQ(scans.size(), 10u);
  EXPECT_FALSE(receiver_.out_of_step());
  EXPECT_EQ(receiver_.counters().refused_scans, 1u);
}

TEST_F(CounterCardReceiverTest, IsOutOfStepWhenTheClockStandsStill) {
  start();
  std::vector<std::byte> still(16 * 20);
  EXPECT_TRUE(push(still).empty());
  EXPECT_TRUE(receiver_.out_of_step());
  EXPECT_EQ(receiver_.refused_step(), 0u);
  EXPECT_DOUBLE_EQ(receiver_.expected_step(), 25.0);
}

TEST_F(CounterCardReceiverTest, KeepsCountsOverARestartOfTheScanAndMarksIt) {
  start();
  card_.x = 4000;
  push(card_.scans(10));
  card_.lose(400);
  card_.x = 4100;
  begin_stream();
  const auto scans = push(card_.scans(10));
  ASSERT_FALSE(scans.empty());
  EXPECT_EQ(scans[0].axes.count[0], 4100);
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::GapBefore));
  EXPECT_EQ(scans[0].axes.head.lost_before, 400u);
}

TEST_F(CounterCardReceiverTest, AnOverrunOfADelayedHostResetsNothing) {
  for (const int batches : {1, 50, 9'000}) {
    start();
    card_.x = 4000;
    for (int i = 0; i < batches; ++i) push(card_.scans(40));
    now_ += 2s;
    push(card_.scans(40));  // from before: read two seconds late
    card_.lose(2 * 40'000 + 4'000);
    now_ += 100ms;
    begin_stream();
    const auto scans = push(card_.scans(40));
    ASSERT_FALSE(scans.empty());
    EXPECT_EQ(receiver_.counters().restarted, 0u);
    EXPECT_EQ(scans[0].axes.count[0], 4000);
    EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::GapBefore));
    EXPECT_FALSE(has(scans[0].axes.head.flags, SampleFlag::Restarted));
    EXPECT_EQ(scans[0].axes.head.lost_before, 84'000u);
  }
}

TEST_F(CounterCardReceiverTest, ALateBatchBeforeOrAfterTheCardWasReopenedResetsNothing) {
  for (const auto& [before, after] : {std::pair{2s, 0s}, std::pair{0s, 2s}}) {
    start();
    for (int i = 0; i < 9'000; ++i) push(card_.scans(40));
    now_ += before;
    push(card_.scans(40));
    card_.lose(10 * 40'000);
    now_ += 10s - before;
    reopen();
    now_ += after;
    ASSERT_FALSE(push(card_.scans(40)).empty());
    EXPECT_EQ(receiver_.counters().restarted, 0u);
    now_ -= after;
  }
}

TEST_F(CounterCardReceiverTest, AClockAheadOfTheHostsMeansThatTheCountersRestarted) {
  start();
  for (int i = 0; i < 9'000; ++i) push(card_.scans(40));
  card_.lose(12 * 40'000);
  now_ += 10s;
  reopen();
  push(card_.scans(40));
  EXPECT_EQ(receiver_.counters().restarted, 1u);
}

/// 32 bits wrap in 72 minutes at 1 MHz: after a day any clock value is possible.
TEST_F(CounterCardReceiverTest, AfterTooLongTheClockCannotShowThatTheCountersContinued) {
  std::uint64_t anew = 0;
  for (const auto& [outage, foreign] : {std::pair{8h, false}, std::pair{24h, true}}) {
    start();
    for (int i = 0; i < 100; ++i) push(card_.scans(40));
    card_.lose(static_cast<std::size_t>(std::chrono::seconds{outage}.count()) * 40'000);
    now_ += outage;
    reopen();
    ASSERT_FALSE(push(card_.scans(40)).empty());
    anew += foreign ? 1 : 0;
    EXPECT_EQ(receiver_.counters().restarted, anew);
  }
}

TEST_F(CounterCardReceiverTest, RestartsWhenACounterIsSetUp) {
  start();
  card_.x = 4000;
  push(card_.scans(10));
  card_ = Card{};
  start();
  const auto scans = push(card_.scans(10));
  ASSERT_FALSE(scans.empty());
  EXPECT_EQ(scans[0].axes.count[0], 0);
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::Restarted));
}

TEST_F(CounterCardReceiverTest, FindsTheBeginningOfAScanInARecording) {
  card_.x = 900;
  const auto bytes = card_.scans(100);
  const auto scans = push(std::span{bytes}.subspan(5));
  ASSERT_GE(scans.size(), 94u);
  EXPECT_EQ(scans.back().axes.count[0], 900);
  EXPECT_EQ(scans.back().clock_count, card_.clock());
  EXPECT_FALSE(scans.back().latched) << "what was latched before is not known";
}

TEST_F(CounterCardReceiverTest, GivesTheLatchInCountsOfTheClock) {
  start();
  push(card_.scans(10));
  card_.latch = card_.clock() + 20 - 111;  // the latch channel was set up 111 counts later
  const auto scans = push(card_.scans(4));
  EXPECT_TRUE(scans[0].latched);
  const auto truth = static_cast<std::int64_t>(card_.latch) + 111;
  EXPECT_LE(std::abs(scans[0].latch_count - truth), scans[0].latch_half_width);
  EXPECT_EQ(receiver_.counters().edges, 1u);
}

TEST_F(CounterCardReceiverTest, TreatsAJumpOfTheClockWithAGapAsARestart) {
  start();
  for (int i = 0; i < 50; ++i) push(card_.scans(40));
  card_.lose(40'000);  // one second
  const auto scans = push(card_.scans(40));
  ASSERT_FALSE(scans.empty());
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::Restarted));
  EXPECT_LT(scans.back().axes.head.time, now_);
  EXPECT_EQ(receiver_.counters().clock_jumps, 1u);
}

TEST_F(CounterCardReceiverTest, DetectsTheRestartAlsoIfALateBatchHidTheJump) {
  start();
  for (int i = 0; i < 50; ++i) push(card_.scans(40));
  card_.lose(3'000);  // 75 ms
  now_ += 60ms;
  const auto late = push(card_.scans(40));
  now_ -= 60ms;

  ASSERT_FALSE(late.empty());
  EXPECT_EQ(receiver_.counters().clock_jumps, 0u);
  EXPECT_FALSE(has(late[0].axes.head.flags, SampleFlag::Restarted));
  const auto scans = push(card_.scans(40));
  ASSERT_FALSE(scans.empty());
  EXPECT_EQ(receiver_.counters().clock_jumps, 1u);
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::Restarted));
  EXPECT_FALSE(has(scans[1].axes.head.flags, SampleFlag::Restarted));
}

TEST_F(CounterCardReceiverTest, AShorterGapAfterTheRestartDoesNotHideIt) {
  start();
  for (int i = 0; i < 50; ++i) push(card_.scans(40));
  card_.lose(3'000);  // 75 ms
  now_ += 100ms;
  push(card_.scans(40));
  card_.lose(1'200);  // 30 ms, which pass
  now_ += 30ms;
  push(card_.scans(40));

  ASSERT_EQ(receiver_.counters().clock_jumps, 0u);
  now_ -= 100ms;
  const auto scans = push(card_.scans(40));
  ASSERT_FALSE(scans.empty());
  EXPECT_EQ(receiver_.counters().clock_jumps, 1u);
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::Restarted));
}

TEST_F(CounterCardReceiverTest, AClockThatWasLateForLongIsNoRestartForAGapBefore) {
  start();
  for (int i = 0; i < 50; ++i) push(card_.scans(40));
  now_ += 200ms;  // from now on all come late
  bool restarted = false;
  for (int i = 0; i < 6'000 && receiver_.counters().clock_jumps == 0; ++i) {
    if (i == 4'800) card_.lose(1'200);  // 30 ms
    for (const auto& scan : push(card_.scans(40)))
      restarted = restarted || has(scan.axes.head.flags, SampleFlag::Restarted);
  }
  EXPECT_EQ(receiver_.counters().clock_jumps, 1u);
  EXPECT_FALSE(restarted);
}

TEST_F(CounterCardReceiverTest, AnEarlierGapThatIsShorterThanTheJumpIsNotItsCause) {
  start();
  now_ += 200ms;  // the host was busy when the first came
  push(card_.scans(40));
  card_.lose(1'200);  // 30 ms
  push(card_.scans(40));
  now_ -= 200ms;
  const auto scans = push(card_.scans(40));
  ASSERT_FALSE(scans.empty());
  EXPECT_EQ(receiver_.counters().clock_jumps, 1u);
  for (const auto& scan : scans) EXPECT_FALSE(has(scan.axes.head.flags, SampleFlag::Restarted));
}

TEST_F(CounterCardReceiverTest, CountsConsistentWithTheClockContinueHoweverLateTheyCome) {
  start();
  now_ += 200ms;  // the host was busy when the first came
  push(card_.scans(40));
  now_ -= 200ms;
  card_.lose(3);
  const auto scans = push(card_.scans(40));
  ASSERT_FALSE(scans.empty());
  EXPECT_EQ(receiver_.counters().clock_jumps, 1u);
  EXPECT_TRUE(has(scans[0].axes.head.flags, SampleFlag::GapBefore));
  EXPECT_FALSE(has(scans[0].axes.head.flags, SampleFlag::Restarted));
  EXPECT_LT(scans.back().axes.head.time, now_);
  EXPECT_GT(scans.back().axes.head.time, now_ - 2ms);
}

}  // namespace
}  // namespace abbe::drivers
