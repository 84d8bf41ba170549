#pragma once
/// Ring of raw bytes from the device thread to the recorder, in blocks of fixed size, so that every
/// recording can be decoded again. One writer, one reader, wait-free. Bytes of one read that exceed
/// a block are split over several blocks with `continued`. If the blocks of a read do not all fit
/// into the ring, the whole read is dropped and its blocks are counted; `lost_before` of the next
/// block holds that number.

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "abbe/drivers/ring_indices.hpp"
#include "abbe/drivers/ring_slots.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

class RawRing {
 public:
  /// `capacity_blocks`: blocks of RawBlock::kCapacity bytes each, rounded up to a power of two.
  /// Allocates and touches the memory.
  explicit RawRing(std::size_t capacity_blocks);

  /// Writer thread. False: all bytes were dropped. A call without bytes writes one empty block,
  /// which records an event at `time`.
  bool push_bytes(protocol::HostTime time, protocol::RawBlock::Direction direction,
                  std::span<const std::byte> bytes) ABBE_RT;

  /// Reader thread. Copies the oldest blocks to `out`; of each block only the first `length` bytes
  /// are copied. Returns the number of blocks.
  std::size_t pop(std::span<protocol::RawBlock> out) ABBE_RT;

  [[nodiscard]] std::size_t capacity() const noexcept { return indices_.capacity(); }
  /// Any thread; blocks written since construction.
  [[nodiscard]] std::uint64_t pushed() const noexcept { return indices_.published(); }
  /// Any thread; blocks dropped since construction.
  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);  // relaxed: a count for display only
  }

 private:
  RingIndices indices_;
  RingSlots<protocol::RawBlock> blocks_;
  /// Writer only: blocks dropped since the last read whose blocks fitted. On a cache line apart
  /// from blocks_, which the reader reads.
  alignas(kNoSharing) std::uint64_t lost_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace abbe::drivers
