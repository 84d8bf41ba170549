#include <gtest/gtest.h>

#include <random>

#include "abbe/drivers/counter_card/latch.hpp"

namespace abbe::drivers {
namespace {

using protocol::quad08::CountWidth;
constexpr std::int64_t kScan = 300;  // clock counts
constexpr std::uint64_t k32 = 0xFFFFFFFF;

/// Feeds scans up to `end`, with one edge at clock count `edge`; the latch channel was zeroed
/// `offset` later.
void run(LatchTracker& tracker, std::int64_t begin, std::int64_t end, std::int64_t edge,
         std::int64_t offset, std::uint64_t& latch_raw) {
  for (std::int64_t clock = begin + kScan; clock <= end; clock += kScan) {
    if (clock >= edge) latch_raw = static_cast<std::uint64_t>(edge + offset) & k32;
    (void)tracker.on_scan(latch_raw, static_cast<std::uint64_t>(clock) & k32, clock, clock - kScan);
  }
}

TEST(LatchTracker, IsExactWhenBothCountersBeginWithTheClock) {
  LatchTracker tracker{CountWidth::Bits32, true};
  std::uint64_t raw = 0;
  run(tracker, 0, 9000, 4321, 0, raw);
  ASSERT_TRUE(tracker.latest());
  EXPECT_EQ(tracker.latest()->clock_count, 4321);
  EXPECT_EQ(tracker.latest()->half_width, 0);
}

TEST(LatchTracker, BoundsTheFirstEdgeOfAForeignClockToOneScan) {
  LatchTracker tracker{CountWidth::Bits32, false};
  std::uint64_t raw = 0;
  run(tracker, 0, 9000, 4321, -123'456, raw);
  ASSERT_TRUE(tracker.latest());
  EXPECT_LE(std::abs(tracker.latest()->clock_count - 4321), tracker.latest()->half_width);
  EXPECT_LE(tracker.latest()->half_width, kScan / 2 + 2);
}

TEST(LatchTracker, NarrowsWithEachEdgeAndKeepsTheTruthInside) {
  std::mt19937 random{3};
  LatchTracker tracker{CountWidth::Bits32, false};
  std::uint64_t raw = 0;
  std::int64_t half_width = kScan;

  for (int touch = 0; touch < 40; ++touch) {
    const std::int64_t begin = 30'000 * touch;
    const std::int64_t edge = begin + 1000 + static_cast<std::int64_t>(random() % 20'000);
    run(tracker, begin, begin + 30'000, edge, -777'777, raw);
    EXPECT_LE(std::abs(tracker.latest()->clock_count - edge), tracker.latest()->half_width);
    EXPECT_LE(tracker.latest()->half_width, half_width);
    half_width = tracker.latest()->half_width;
  }

  EXPECT_LT(half_width, 20);
  EXPECT_EQ(tracker.disagreements(), 0u);
}

TEST(LatchTracker, UnwrapsALatchThatIsMuchOlderThanTheClocksRange) {
  LatchTracker tracker{CountWidth::Bits32, true};
  std::uint64_t raw = 0;
  const std::int64_t far = std::int64_t{3} << 32;
  const std::int64_t begin = far - far % kScan;
  run(tracker, begin, begin + 9000, begin + 5001, 0, raw);
  EXPECT_EQ(tracker.latest()->clock_count, begin + 5001);
}

TEST(LatchTracker, DetectsALatchOfAnotherClock) {
  LatchTracker tracker{CountWidth::Bits32, true};
  std::uint64_t raw = 0;
  run(tracker, 0, 9000, 4321, 50'000, raw);
  EXPECT_EQ(tracker.disagreements(), 1u);
  EXPECT_GT(tracker.latest()->half_width, 0);
  EXPECT_LE(std::abs(tracker.latest()->clock_count - 4321), tracker.latest()->half_width);
}

TEST(LatchTracker, GivesNoTimeBeforeTheFirstEdge) {
  LatchTracker tracker{CountWidth::Bits48, false};
  std::uint64_t raw = 0;
  run(tracker, 0, 9000, 1'000'000, 0, raw);
  EXPECT_FALSE(tracker.latest());
}

}  // namespace
}  // namespace abbe::drivers
