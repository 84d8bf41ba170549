#include <gtest/gtest.h>

#include <array>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"

namespace abbe::tests {
namespace {

using drivers::RawRing;
using drivers::SampleRing;
using protocol::HostTime;
using protocol::ProbeTrigger;
using protocol::RawBlock;
using protocol::SampleFlag;

ProbeTrigger touch(std::uint32_t number) {
  ProbeTrigger t;
  t.touch = number;
  return t;
}

std::vector<ProbeTrigger> pop_all(SampleRing<ProbeTrigger>& ring) {
  std::vector<ProbeTrigger> out(ring.capacity());
  out.resize(ring.pop(out));
  return out;
}

TEST(SampleRing, RoundsItsCapacityUpToAPowerOfTwo) {
  EXPECT_EQ(SampleRing<ProbeTrigger>(5).capacity(), 8u);
  EXPECT_EQ(SampleRing<ProbeTrigger>(8).capacity(), 8u);
  EXPECT_EQ(SampleRing<ProbeTrigger>(0).capacity(), 2u);
}

TEST(SampleRing, GivesSamplesBackInOrder) {
  SampleRing<ProbeTrigger> ring(8);
  std::uint32_t next_in = 0;
  std::uint32_t next_out = 0;
  for (int turn = 0; turn < 10; ++turn) {  // wraps several times
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(ring.try_push(touch(next_in++)));
    for (const auto& t : pop_all(ring)) EXPECT_EQ(t.touch, next_out++);
  }
  EXPECT_EQ(next_out, next_in);
}

TEST(SampleRing, PopsNoMoreThanAskedFor) {
  SampleRing<ProbeTrigger> ring(8);
  for (std::uint32_t i = 0; i < 5; ++i) ring.try_push(touch(i));
  std::array<ProbeTrigger, 3> out{};
  EXPECT_EQ(ring.pop(out), 3u);
  EXPECT_EQ(ring.pop(out), 2u);
  EXPECT_EQ(ring.pop(out), 0u);
}

TEST(SampleRing, DropsAndCountsWhenFull) {
  SampleRing<ProbeTrigger> ring(4);
  for (std::uint32_t i = 0; i < 4; ++i) EXPECT_TRUE(ring.try_push(touch(i)));
  EXPECT_FALSE(ring.try_push(touch(4)));
  EXPECT_FALSE(ring.try_push(touch(5)));
  EXPECT_EQ(ring.dropped(), 2u);
  EXPECT_EQ(pop_all(ring).size(), 4u);
}

TEST(SampleRing, MarksTheGapOnTheNextSampleThatFits) {
  SampleRing<ProbeTrigger> ring(4);
  for (std::uint32_t i = 0; i < 7; ++i) ring.try_push(touch(i));
  pop_all(ring);
  ring.try_push(touch(7));
  ring.try_push(touch(8));
  const auto out = pop_all(ring);
  ASSERT_EQ(out.size(), 2u);
  EXPECT_TRUE(has(out[0].head.flags, SampleFlag::GapBefore));
  EXPECT_EQ(out[0].head.lost_before, 3u);
  EXPECT_EQ(out[1].head.flags, 0u);
}

TEST(SampleRing, AddsItsLossToWhatTheDriverReports) {
  SampleRing<ProbeTrigger> ring(2);
  for (std::uint32_t i = 0; i < 3; ++i) ring.try_push(touch(i));
  pop_all(ring);
  ProbeTrigger t = touch(3);
  t.head.lost_before = 10;
  ring.try_push(t);
  EXPECT_EQ(pop_all(ring)[0].head.lost_before, 11u);
}

TEST(SampleRing, PushesABatchInOneGo) {
  SampleRing<ProbeTrigger> ring(8);
  std::array<ProbeTrigger, 5> batch{};
  for (std::uint32_t i = 0; i < batch.size(); ++i) batch[i].touch = i;
  for (int turn = 0; turn < 5; ++turn) {  // wraps inside a batch
    EXPECT_EQ(ring.push(batch), 5u);
    const auto out = pop_all(ring);
    ASSERT_EQ(out.size(), 5u);
    for (std::uint32_t i = 0; i < out.size(); ++i) EXPECT_EQ(out[i].touch, i);
  }
}

TEST(SampleRing, KeepsTheBeginningOfABatchThatDoesNotFit) {
  SampleRing<ProbeTrigger> ring(4);
  std::array<ProbeTrigger, 6> batch{};
  EXPECT_EQ(ring.push(batch), 4u);
  EXPECT_EQ(ring.push(batch), 0u);
  EXPECT_EQ(ring.dropped(), 8u);
  pop_all(ring);
  EXPECT_EQ(ring.push(batch), 4u);
  EXPECT_EQ(pop_all(ring)[0].head.lost_before, 8u);
}

// Writer and reader in two threads, the ring too small on purpose: what arrives plus what is marked
// as lost is all.
TEST(SampleRing, LosesNothingUncountedBetweenTwoThreads) {
  constexpr std::uint32_t kSamples = 200'000;
  SampleRing<ProbeTrigger> ring(64);
  std::thread writer([&] {
    for (std::uint32_t i = 0; i < kSamples; ++i) ring.try_push(touch(i));
  });

  std::uint64_t taken = 0;
  std::uint64_t wrong = 0;
  std::array<ProbeTrigger, 16> out{};
  std::uint32_t expected = 0;

  const auto take = [&] {
    const std::size_t n = ring.pop(out);
    for (std::size_t i = 0; i < n; ++i) {
      wrong += out[i].touch == expected + out[i].head.lost_before ? 0 : 1;
      expected = out[i].touch + 1;
    }
    taken += n;
    return n;
  };

  while (taken + ring.dropped() < kSamples) {
    if (take() == 0) std::this_thread::yield();
  }

  writer.join();
  while (take() != 0) {
  }
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(taken + ring.dropped(), kSamples);
}

std::vector<std::byte> numbered_bytes(std::size_t n) {
  std::vector<std::byte> bytes(n);
  for (std::size_t i = 0; i < n; ++i) bytes[i] = static_cast<std::byte>(i * 7 + i / 256);
  return bytes;
}

std::vector<RawBlock> pop_all(RawRing& ring) {
  std::vector<RawBlock> out(ring.capacity());
  out.resize(ring.pop(out));
  return out;
}

TEST(RawRing, KeepsAShortReadInOneBlock) {
  RawRing ring(4);
  const auto bytes = numbered_bytes(100);
  ASSERT_TRUE(
      ring.push_bytes(HostTime{std::chrono::seconds{7}}, RawBlock::Direction::ToDevice, bytes));
  const auto out = pop_all(ring);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].time, HostTime{std::chrono::seconds{7}});
  EXPECT_EQ(out[0].direction, RawBlock::Direction::ToDevice);
  EXPECT_FALSE(out[0].continued);
  EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), out[0].bytes.begin(),
                         out[0].bytes.begin() + out[0].length));
}

TEST(RawRing, CutsALongReadIntoContinuedBlocks) {
  RawRing ring(8);
  const auto bytes = numbered_bytes(2 * RawBlock::kCapacity + 10);
  ASSERT_TRUE(ring.push_bytes(HostTime{}, RawBlock::Direction::FromDevice, bytes));
  std::vector<std::byte> joined;
  std::vector<bool> continued;
  for (const auto& b : pop_all(ring)) {
    joined.insert(joined.end(), b.bytes.begin(), b.bytes.begin() + b.length);
    continued.push_back(b.continued);
  }
  EXPECT_EQ(joined, bytes);
  EXPECT_EQ(continued, (std::vector<bool>{true, true, false}));
}

TEST(RawRing, EndsAReadOfExactlyOneBlock) {
  RawRing ring(2);
  ASSERT_TRUE(ring.push_bytes(HostTime{}, RawBlock::Direction::FromDevice,
                              numbered_bytes(RawBlock::kCapacity)));
  const auto out = pop_all(ring);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_FALSE(out[0].continued);
}

TEST(RawRing, DropsAReadWholeAndMarksTheNext) {
  RawRing ring(4);
  const auto three_blocks = numbered_bytes(3 * RawBlock::kCapacity);
  ASSERT_TRUE(ring.push_bytes(HostTime{}, RawBlock::Direction::FromDevice, three_blocks));
  EXPECT_FALSE(ring.push_bytes(HostTime{}, RawBlock::Direction::FromDevice, three_blocks));
  EXPECT_EQ(ring.dropped(), 3u);
  ASSERT_TRUE(ring.push_bytes(HostTime{}, RawBlock::Direction::FromDevice, numbered_bytes(5)));
  const auto out = pop_all(ring);
  ASSERT_EQ(out.size(), 4u);
  EXPECT_EQ(out[2].lost_before, 0u);
  EXPECT_EQ(out[3].lost_before, 3u);
}

}  // namespace
}  // namespace abbe::tests
