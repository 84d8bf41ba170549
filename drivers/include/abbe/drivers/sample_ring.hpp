#pragma once
/// Ring of decoded samples from the real-time device thread to the hub (the thread of abbed that
/// reads the rings of all devices). One writer, one reader, wait-free on both sides
/// (boost::lockfree::spsc_queue). If the ring is full, a new sample is dropped and counted, and the
/// next sample that fits carries GapBefore and `lost_before`. The constructor allocates and touches
/// all memory.

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
  static_assert(std::is_trivially_copyable_v<T>, "a sample is copied as bytes between the threads");

 public:
  /// Capacity is rounded up to a power of two. Allocates.
  explicit SampleRing(std::size_t capacity)
      : capacity_(std::bit_ceil(std::max<std::size_t>(capacity, 2))), queue_(capacity_) {
    while (queue_.push(T{})) {
    }
    queue_.reset();
  }

  /// Writer thread. False: the ring is full; the sample was dropped and counted.
  bool try_push(const T& sample) ABBE_RT {
    if (lost_ != 0) [[unlikely]]
      return push_marked(sample);
    if (!queue_.push(sample)) [[unlikely]] {
      drop(1);
      return false;
    }
    return true;
  }

  /// Writer thread. Pushes the first samples that fit and drops the rest; returns the number
  /// pushed. The write counter is published once for all samples, which is cheaper than try_push()
  /// in a loop when a device delivers bursts.
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
    return dropped_.load(std::memory_order_relaxed);  // relaxed: a count for display only
  }

 private:
  /// Counts `n` dropped samples. Only the writer stores, so no atomic read-modify-write is needed.
  [[gnu::cold, gnu::noinline]] void drop(std::size_t n) ABBE_RT {
    lost_ += n;
    dropped_.store(dropped_.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
  }
  /// Pushes the first sample after a loss: it carries GapBefore and the number of lost samples.
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

  /// Memory of the queue, aligned to cache lines: a sample of 64 bytes that crosses two lines
  /// halves the throughput of the ring.
  using Memory = boost::lockfree::allocator<boost::alignment::aligned_allocator<T, kNoSharing>>;

  std::size_t capacity_;
  boost::lockfree::spsc_queue<T, Memory> queue_;
  /// Writer only: samples dropped since the last one that fitted. On a cache line apart from the
  /// queue, which the reader reads.
  alignas(kNoSharing) std::uint64_t lost_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace abbe::drivers
