#include "abbe/drivers/latency_histogram.hpp"

#include <algorithm>
#include <bit>

namespace abbe::drivers {

std::size_t LatencyHistogram::bucket_of(std::chrono::nanoseconds duration) ABBE_RT {
  const auto ns = static_cast<std::uint64_t>(std::max<std::int64_t>(duration.count(), 1));
  const auto octave = static_cast<std::size_t>(std::bit_width(ns) - 1);
  const std::uint64_t above = ns - (std::uint64_t{1} << octave);  // 0 .. 2^octave - 1
  const std::size_t quarter = static_cast<std::size_t>((above * kBucketsPerOctave) >> octave);
  return std::min(octave * kBucketsPerOctave + quarter, kBuckets - 1);
}

void LatencyHistogram::record(std::chrono::nanoseconds duration) ABBE_RT {
  auto& count = counts_[bucket_of(duration)];
  count.store(count.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (duration.count() > largest_ns_.load(std::memory_order_relaxed)) {
    largest_ns_.store(duration.count(), std::memory_order_relaxed);
  }
}

}  // namespace abbe::drivers
