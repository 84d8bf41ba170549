#pragma once
/// The border between the two worlds: decoded samples from the real-time side to the ordinary side. One
/// writer, one reader, wait-free on both sides. Full means: drop, count, and mark the next sample that fits
/// with GapBefore and `lost_before`. All memory is taken and touched by the constructor.

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

#include "abbe/drivers/ring_indices.hpp"
#include "abbe/drivers/ring_slots.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

template <class T>
class SampleRing {
  static_assert(std::is_trivially_copyable_v<T>, "a sample is copied as bytes across the border");

 public:
  /// Capacity is rounded up to a power of two. Allocates.
  explicit SampleRing(std::size_t capacity) : indices_(capacity), slots_(indices_.capacity()) {}

  /// Writer thread. False: full, the sample is dropped and counted.
  bool try_push(const T& sample) ABBE_RT {
    if (indices_.free_slots(1) == 0) [[unlikely]] {
      drop(1);
      return false;
    }
    T& slot = slots_[indices_.slot(indices_.write_counter())];
    slot = sample;
    if (lost_ != 0) [[unlikely]]
      mark_gap(slot);
    indices_.publish(1);
    return true;
  }

  /// Writer thread. Pushes the first ones that fit, drops the rest; returns how many were pushed. One
  /// publication for all: cheaper than try_push in a loop when a device delivers bursts.
  std::size_t push(std::span<const T> samples) ABBE_RT {
    const std::size_t n = indices_.free_slots(samples.size());
    if (n != 0) {
      const std::size_t begin = indices_.slot(indices_.write_counter());
      const std::size_t straight = std::min(n, indices_.capacity() - begin);
      std::copy_n(samples.data(), straight, &slots_[begin]);
      std::copy_n(samples.data() + straight, n - straight, &slots_[0]);
      if (lost_ != 0) mark_gap(slots_[begin]);
      indices_.publish(n);
    }
    if (n < samples.size()) drop(samples.size() - n);
    return n;
  }

  /// Reader thread. Fills `out` from the front with the oldest samples; returns how many.
  std::size_t pop(std::span<T> out) ABBE_RT {
    const std::size_t n = indices_.filled_slots(out.size());
    if (n == 0) return 0;
    const std::size_t begin = indices_.slot(indices_.read_counter());
    const std::size_t straight = std::min(n, indices_.capacity() - begin);
    std::copy_n(&slots_[begin], straight, out.data());
    std::copy_n(&slots_[0], n - straight, out.data() + straight);
    indices_.consume(n);
    return n;
  }

  [[nodiscard]] std::size_t capacity() const noexcept { return indices_.capacity(); }
  /// Any thread.
  [[nodiscard]] std::uint64_t pushed() const noexcept { return indices_.published(); }
  /// Any thread.
  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);  // relaxed: a count for people, orders nothing
  }

 private:
  [[gnu::cold, gnu::noinline]] void drop(std::size_t n) ABBE_RT {
    lost_ += n;
    // relaxed, and no read-modify-write: the writer is the only one who stores
    dropped_.store(dropped_.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
  }
  [[gnu::cold, gnu::noinline]] void mark_gap(T& sample) ABBE_RT {
    const std::uint64_t lost = lost_ + sample.head.lost_before;
    sample.head.lost_before =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(lost, std::numeric_limits<std::uint32_t>::max()));
    sample.head.flags |= protocol::SampleFlag::GapBefore;
    lost_ = 0;
  }

  RingIndices indices_;
  RingSlots<T> slots_;
  /// Writer only: dropped since the last sample that fitted. Apart from slots_, which the reader reads.
  alignas(kNoSharing) std::uint64_t lost_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace abbe::drivers
