#pragma once
/// Raw bytes from the real-time side to the recorder, in blocks of fixed size, so that every
/// recording can be decoded again. One writer, one reader, wait-free. A read longer than one block
/// is cut into several with `continued`; a read whose blocks do not all fit is dropped whole,
/// counted in blocks, and marked by `lost_before` on the next one.

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
  /// Blocks of RawBlock::kCapacity bytes, rounded up to a power of two. Allocates and touches the
  /// memory.
  explicit RawRing(std::size_t capacity_blocks);

  /// Writer thread. False: dropped whole. Zero bytes are one empty block (a device may say nothing,
  /// at a time).
  bool push_bytes(protocol::HostTime time, protocol::RawBlock::Direction direction,
                  std::span<const std::byte> bytes) ABBE_RT;

  /// Reader thread. Oldest blocks first; only `length` bytes of each are copied. Returns how many
  /// blocks.
  std::size_t pop(std::span<protocol::RawBlock> out) ABBE_RT;

  [[nodiscard]] std::size_t capacity() const noexcept { return indices_.capacity(); }
  /// Any thread; blocks since construction.
  [[nodiscard]] std::uint64_t pushed() const noexcept { return indices_.published(); }
  /// Any thread; blocks since construction.
  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);  // relaxed: a count for people, orders nothing
  }

 private:
  RingIndices indices_;
  RingSlots<protocol::RawBlock> blocks_;
  /// Writer only: blocks dropped since the last read that fitted. Apart from blocks_, which the
  /// reader reads.
  alignas(kNoSharing) std::uint64_t lost_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace abbe::drivers
