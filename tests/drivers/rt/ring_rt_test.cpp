#include <array>

#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "rt_guards.hpp"

namespace abbe::tests {
namespace {

using drivers::RawRing;
using drivers::SampleRing;
using protocol::HostTime;
using protocol::RawBlock;
using protocol::TrackerPoint;

TEST(SampleRingRt, TakesNoMemoryIn10000Samples) {
  SampleRing<TrackerPoint> ring(1024);
  std::array<TrackerPoint, 16> out{};
  expect_no_allocation(10'000, [&](std::size_t i) {
    ring.try_push({});
    if (i % 32 == 0) ring.pop(out);  // and so it also overflows
  });
  EXPECT_GT(ring.dropped(), 0u);
}

TEST(SampleRingRt, MakesNoSystemCall) {
  SampleRing<TrackerPoint> ring(64);
  std::array<TrackerPoint, 16> out{};
  expect_no_system_call([&] {
    for (int i = 0; i < 100; ++i) ring.try_push({});
    ring.push(out);
    ring.pop(out);
  });
}

TEST(RawRingRt, TakesNoMemoryIn10000Reads) {
  RawRing ring(64);
  const std::array<std::byte, 5000> bytes{};
  std::array<RawBlock, 4> out;  // NOLINT
  expect_no_allocation(10'000, [&](std::size_t i) {
    ring.push_bytes(HostTime{}, RawBlock::Direction::FromDevice, bytes);
    if (i % 2 == 0) ring.pop(out);
  });
  EXPECT_GT(ring.dropped(), 0u);
}

TEST(RawRingRt, MakesNoSystemCall) {
  RawRing ring(8);
  const std::array<std::byte, 5000> bytes{};
  std::array<RawBlock, 4> out;  // NOLINT
  expect_no_system_call([&] {
    for (int i = 0; i < 10; ++i)
      ring.push_bytes(HostTime{}, RawBlock::Direction::FromDevice, bytes);
    ring.pop(out);
  });
}

}  // namespace
}  // namespace abbe::tests
