#include "abbe/drivers/latency_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::drivers {

std::chrono::nanoseconds LatencyHistogram::upper_bound(std::size_t bucket) noexcept {
  const std::size_t octave = bucket / kBucketsPerOctave;
  const std::size_t quarter = bucket % kBucketsPerOctave;
  // Each octave [2^o, 2^(o+1)) has four equal buckets, as in bucket_of(). Integers only.
  const std::uint64_t base = std::uint64_t{1} << octave;
  return std::chrono::nanoseconds{
      static_cast<std::int64_t>(base + (base * (quarter + 1) + 3) / kBucketsPerOctave)};
}

LatencyHistogram::Counts LatencyHistogram::read() const noexcept {
  Counts c;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    c.of_bucket[i] = counts_[i].load(std::memory_order_relaxed);
    c.total += c.of_bucket[i];
  }
  c.largest = std::chrono::nanoseconds{largest_ns_.load(std::memory_order_relaxed)};
  return c;
}

std::chrono::nanoseconds LatencyHistogram::Counts::quantile(double share) const noexcept {
  const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(total)));
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i + 1 < kBuckets; ++i) {  // the last bucket has no upper limit
    seen += of_bucket[i];
    if (seen >= wanted && seen != 0) return std::min(upper_bound(i), largest);
  }
  return largest;
}

}  // namespace abbe::drivers
