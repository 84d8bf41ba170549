#pragma once
/// Durations in four equal buckets per octave (so each is known to 12-25 %), 1 ns to 17 s. Filled
/// by the real-time loop itself, read by any thread at any time: a report, never a lock.

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "abbe/protocol/rt.hpp"

namespace abbe::drivers {

class LatencyHistogram {
 public:
  static constexpr std::size_t kBucketsPerOctave = 4;
  static constexpr std::size_t kBuckets = 34 * kBucketsPerOctave;

  /// A copy to compute with.
  struct Counts {
    std::array<std::uint64_t, kBuckets> of_bucket{};
    std::uint64_t total = 0;
    std::chrono::nanoseconds largest{};
    /// Upper bound of the bucket that holds the given share (0 to 1) of all durations, never above
    /// `largest`.
    [[nodiscard]] std::chrono::nanoseconds quantile(double share) const noexcept;
  };

  /// The one writer thread.
  void record(std::chrono::nanoseconds duration) ABBE_RT;
  /// Any thread.
  [[nodiscard]] Counts read() const noexcept;

  [[nodiscard]] static std::size_t bucket_of(std::chrono::nanoseconds duration) ABBE_RT;
  /// Exclusive upper bound of a bucket.
  [[nodiscard]] static std::chrono::nanoseconds upper_bound(std::size_t bucket) noexcept;

 private:
  // relaxed throughout, stored by one thread: counts for people, they order nothing
  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::int64_t> largest_ns_{0};
};

}  // namespace abbe::drivers
