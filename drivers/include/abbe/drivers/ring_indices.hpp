#pragma once
/// The two counters of a ring buffer with one writer and one reader, wait-free [Lamport 1983]. Each
/// side keeps a private copy of the other side's counter, so that the shared cache line is read
/// only when necessary. The counters have 64 bits and never overflow in practice; slot = counter &
/// mask. Only the writer thread may call writer functions, only the reader thread reader functions;
/// any thread may call `published()`.

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "abbe/protocol/rt.hpp"

namespace abbe::drivers {

/// Alignment against false sharing: two cache lines of 64 bytes, because x86 prefetches them in
/// pairs.
inline constexpr std::size_t kNoSharing = 128;

class RingIndices {
 public:
  /// `capacity` is rounded up to a power of two, at least 2.
  explicit RingIndices(std::size_t capacity) noexcept
      : mask_(std::bit_ceil(std::max<std::size_t>(capacity, 2)) - 1) {}

  [[nodiscard]] std::size_t capacity() const noexcept { return mask_ + 1; }
  [[nodiscard]] std::size_t slot(std::uint64_t counter) const noexcept { return counter & mask_; }

  /// Writer: how many of `wanted` slots are free, starting at write_counter().
  [[nodiscard]] std::size_t free_slots(std::size_t wanted) ABBE_RT {
    const std::uint64_t written = written_.load(std::memory_order_relaxed);  // own counter
    if (capacity() - (written - read_seen_) < wanted) {
      // acquire: pairs with the release in consume()
      read_seen_ = read_.load(std::memory_order_acquire);
    }
    return std::min<std::size_t>(wanted, capacity() - (written - read_seen_));
  }
  [[nodiscard]] std::uint64_t write_counter() const ABBE_RT {
    return written_.load(std::memory_order_relaxed);
  }
  /// Writer: makes `n` filled slots visible to the reader.
  void publish(std::size_t n) ABBE_RT {
    // release: pairs with the acquire in filled_slots(); the slots' contents are visible before the
    // counter.
    written_.store(written_.load(std::memory_order_relaxed) + n, std::memory_order_release);
  }

  /// Reader: how many of `wanted` slots are filled, starting at read_counter().
  [[nodiscard]] std::size_t filled_slots(std::size_t wanted) ABBE_RT {
    const std::uint64_t read = read_.load(std::memory_order_relaxed);  // own counter
    if (written_seen_ - read < wanted) {
      // acquire: pairs with the release in publish()
      written_seen_ = written_.load(std::memory_order_acquire);
    }
    return std::min<std::size_t>(wanted, written_seen_ - read);
  }
  [[nodiscard]] std::uint64_t read_counter() const ABBE_RT {
    return read_.load(std::memory_order_relaxed);
  }
  /// Reader: releases `n` slots that have been read, for the writer to fill again.
  void consume(std::size_t n) ABBE_RT {
    // release: pairs with the acquire in free_slots(); the slots are read before they may be
    // overwritten.
    read_.store(read_.load(std::memory_order_relaxed) + n, std::memory_order_release);
  }

  /// Any thread: slots published since construction.
  [[nodiscard]] std::uint64_t published() const noexcept {
    return written_.load(std::memory_order_relaxed);  // relaxed: a count for display only
  }

 private:
  std::size_t mask_;
  alignas(kNoSharing) std::atomic<std::uint64_t> written_{0};  ///< stored by the writer only
  std::uint64_t read_seen_ = 0;                                ///< writer's copy of read_
  alignas(kNoSharing) std::atomic<std::uint64_t> read_{0};     ///< stored by the reader only
  std::uint64_t written_seen_ = 0;                             ///< reader's copy of written_
};

}  // namespace abbe::drivers
