#include "abbe/drivers/status_board.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

#include "abbe/drivers/latency_histogram.hpp"
#include "abbe/drivers/time_source.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::FaultText;
using drivers::LatencyHistogram;
using drivers::MonotonicTime;
using drivers::StatusBoard;
using protocol::HostTime;
using std::chrono::nanoseconds;

TEST(StatusBoard, ReadsBackWhatWasWritten) {
  StatusBoard board;
  board.set_state("streaming");
  board.set_connected(true);
  board.samples.add(3);
  board.gaps.add();
  board.fault(HostTime{9s}, "tracker: no reply in 3 s");
  board.set_last_sample(HostTime{8s});
  board.set_clock({.settled = true, .skew = 1e-6, .restarts = 2});
  const auto s = board.read("tracker", 4, 5);

  EXPECT_EQ(s.name, "tracker");
  EXPECT_EQ(s.state, "streaming");
  EXPECT_TRUE(s.connected);
  EXPECT_EQ(s.samples, 3u);
  EXPECT_EQ(s.dropped, 4u);
  EXPECT_EQ(s.raw_dropped, 5u);
  EXPECT_EQ(s.gaps, 1u);
  EXPECT_EQ(s.faults, 1u);
  EXPECT_EQ(s.last_fault, "tracker: no reply in 3 s");
  EXPECT_EQ(s.last_fault_at, HostTime{9s});
  EXPECT_EQ(s.last_sample, HostTime{8s});
  EXPECT_EQ(s.clock.restarts, 2u);
}

TEST(FaultText, CutsWhatIsTooLong) {
  FaultText text;
  text.set(HostTime{}, std::string(1000, 'x'));
  EXPECT_EQ(text.read().text, std::string(FaultText::kCapacity, 'x'));
}

TEST(FaultText, CutsBetweenCharactersNotWithinOne) {
  FaultText text;
  text.set(HostTime{}, std::string(FaultText::kCapacity - 1, 'x').append("\u00b5m"));
  EXPECT_EQ(text.read().text, std::string(FaultText::kCapacity - 1, 'x'));
  text.set(HostTime{}, std::string(FaultText::kCapacity - 2, 'x').append("\u00b5"));
  EXPECT_EQ(text.read().text, std::string(FaultText::kCapacity - 2, 'x').append("\u00b5"));
}

TEST(FaultText, NeverShowsPartsOfTwo) {
  FaultText text;
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    for (char c = 'a'; !stop; c = c == 'z' ? 'a' : static_cast<char>(c + 1))
      text.set(HostTime{}, std::string(150, c));
  });

  int torn = 0;
  for (int i = 0; i < 2000; ++i) {
    const std::string seen = text.read().text;
    if (!seen.empty() && seen != std::string(150, seen[0])) ++torn;
  }

  stop = true;
  writer.join();
  EXPECT_EQ(torn, 0);
}

TEST(LatencyHistogram, PutsEveryDurationBelowItsBucketsBoundAndAboveTheLast) {
  for (std::int64_t ns = 1; ns < 1'000'000'000'000; ns += 1 + ns / 7) {
    const std::size_t b = LatencyHistogram::bucket_of(nanoseconds{ns});
    if (b + 1 == LatencyHistogram::kBuckets) break;  // the last one takes all the rest
    EXPECT_LT(nanoseconds{ns}, LatencyHistogram::upper_bound(b)) << ns;
    const nanoseconds lower = b == 0 ? 0ns : LatencyHistogram::upper_bound(b - 1);
    EXPECT_GE(nanoseconds{ns}, lower) << ns;
  }
}

TEST(LatencyHistogram, GivesItsQuantilesToAQuarterOctave) {
  LatencyHistogram h;
  for (int i = 1; i <= 1000; ++i) h.record(i * 1us);
  const auto counts = h.read();
  EXPECT_EQ(counts.total, 1000u);
  EXPECT_EQ(counts.largest, 1ms);
  EXPECT_GE(counts.quantile(0.5), 500us);
  EXPECT_LE(counts.quantile(0.5), 625us);
  EXPECT_EQ(counts.quantile(1.0), 1ms);
}

TEST(LatencyHistogram, KeepsWhatFitsNoBucket) {
  LatencyHistogram h;
  h.record(-5ns);
  h.record(0ns);
  h.record(3600s);
  EXPECT_EQ(h.read().total, 3u);
  EXPECT_EQ(h.read().quantile(1.0), 3600s);
}

TEST(MonotonicTime, RunsAtTheGivenSpeed) {
  const MonotonicTime real(1.0);
  const MonotonicTime fast(100.0);
  const auto before = real.now();
  const auto seen = fast.now();
  const auto after = real.now();
  EXPECT_GE(seen.time_since_epoch(),
            100 * before.time_since_epoch() - 1ms);  // a double has 1e-16 of a month of 100 x
  EXPECT_LE(seen.time_since_epoch(), 100 * after.time_since_epoch() + 1ms);
  EXPECT_EQ(fast.wall(1s), 10ms);
  EXPECT_EQ(fast.host(1s), 100s);
}

TEST(SteppedTime, MovesOnlyWhenStepped) {
  SteppedTime time(HostTime{5s});
  EXPECT_EQ(time.now(), HostTime{5s});
  time.advance(20ms);
  EXPECT_EQ(time.now(), HostTime{5020ms});
  EXPECT_EQ(time.wall(1s), 0ns);
}

}  // namespace
}  // namespace abbe::tests
