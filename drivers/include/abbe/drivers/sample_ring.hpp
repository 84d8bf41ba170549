#pragma once
/// The border between the two worlds: decoded samples from the real-time side to the ordinary side.
/// One writer, one reader, wait-free on both sides: boost::lockfree::spsc_queue behind the rule of
/// the house. Full means: drop, count, and mark the next sample that fits with GapBefore and
/// `lost_before`. All memory is taken and touched by the constructor.

#include <algorithm>
#include <atomic>
#include <bit>
#include <boost/align/aligned_allocator.hpp>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

#include "abbe/drivers/ring_indices.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

template <class T>
class SampleRing {
  static_assert(std::is_trivially_copyable_v<T>, "a sample is copied as bytes across the border");

 public:
  /// Capacity is rounded up to a power of two. Allocates.
  explicit SampleRing(std::size_t capacity)
      : capacity_(std::bit_ceil(std::max<std::size_t>(capacity, 2))), queue_(capacity_) {
    while (queue_.push(T{})) {
    }
    queue_.reset();
  }

  /// Writer thread. False: full, the sample is dropped and counted.
  bool try_push(const T& sample) ABBE_RT {
    if (lost_ != 0) [[unlikely]]
      return push_marked(sample);
    if (!queue_.push(sample)) [[unlikely]] {
      drop(1);
      return false;
    }
    return true;
  }

  /// Writer thread. Pushes the first ones that fit, drops the rest; returns how many were pushed.
  /// One publication for all: cheaper than try_push in a loop when a device delivers bursts.
  std::size_t push(std::span<const T> samples) ABBE_RT {
    std::size_t n = 0;
    if (lost_ != 0 && !samples.empty()) [[unlikely]] {
      if (!push_marked(samples.front())) {
        drop(samples.size() - 1);
        return 0;
      }
      n = 1;
    }
    n += queue_.push(samples.data() + n, samples.size() - n);
    if (n < samples.size()) drop(samples.size() - n);
    return n;
  }

  /// Reader thread. Fills `out` from the front with the oldest samples; returns how many.
  std::size_t pop(std::span<T> out) ABBE_RT { return queue_.pop(out.data(), out.size()); }

  [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }
  /// Any thread.
  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);  // relaxed: a count for people, orders nothing
  }

 private:
  /// The writer is the only one who stores: no read-modify-write.
  [[gnu::cold, gnu::noinline]] void drop(std::size_t n) ABBE_RT {
    lost_ += n;
    dropped_.store(dropped_.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
  }
  /// The first sample after a loss says so.
  [[gnu::cold, gnu::noinline]] bool push_marked(T sample) ABBE_RT {
    const std::uint64_t lost = lost_ + sample.head.lost_before;
    sample.head.lost_before = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(lost, std::numeric_limits<std::uint32_t>::max()));
    sample.head.flags |= protocol::SampleFlag::GapBefore;
    if (!queue_.push(sample)) {
      drop(1);
      return false;
    }
    lost_ = 0;
    return true;
  }

  /// Aligned because a sample of 64 bytes that lies across two cache lines halves what the ring
  /// carries.
  using Memory = boost::lockfree::allocator<boost::alignment::aligned_allocator<T, kNoSharing>>;

  std::size_t capacity_;
  boost::lockfree::spsc_queue<T, Memory> queue_;
  /// Writer only: dropped since the last sample that fitted. Apart from the queue, which the reader
  /// reads.
  alignas(kNoSharing) std::uint64_t lost_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace abbe::drivers
