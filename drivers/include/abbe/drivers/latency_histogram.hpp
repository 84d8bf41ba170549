#pragma once
/// Histogram of durations with four equal buckets per octave (resolution 12 to 25 %), 1 ns to 17 s.
/// The real-time loop fills it, any thread may read it at any time. Lock-free.

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

  /// A copy of the counts, for evaluation.
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
  // One thread stores the counts. relaxed: they are for display only and order no other access.
  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::int64_t> largest_ns_{0};
};

}  // namespace abbe::drivers
