#include "abbe/drivers/raw_ring.hpp"

#include <algorithm>
#include <limits>

namespace abbe::drivers {
namespace {

using protocol::RawBlock;

std::size_t blocks_for(std::size_t length) noexcept {
  return length == 0 ? 1 : (length + RawBlock::kCapacity - 1) / RawBlock::kCapacity;
}

void copy_used(const RawBlock& from, RawBlock& to) noexcept {
  to.time = from.time;
  to.lost_before = from.lost_before;
  to.length = from.length;
  to.continued = from.continued;
  to.direction = from.direction;
  std::copy_n(from.bytes.begin(), from.length, to.bytes.begin());
}

}  // namespace

bool RawRing::push_bytes(protocol::HostTime time, RawBlock::Direction direction,
                         std::span<const std::byte> bytes) ABBE_RT {
  const std::size_t needed = blocks_for(bytes.size());
  if (indices_.free_slots(needed) < needed) {
    lost_ += needed;
    // relaxed, and no read-modify-write: only the writer stores
    dropped_.store(dropped_.load(std::memory_order_relaxed) + needed, std::memory_order_relaxed);
    return false;
  }
  for (std::size_t i = 0; i < needed; ++i) {
    RawBlock& block = blocks_[indices_.slot(indices_.write_counter() + i)];
    const std::size_t length = std::min(bytes.size(), RawBlock::kCapacity);
    block.time = time;
    block.direction = direction;
    block.lost_before = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(lost_, std::numeric_limits<std::uint32_t>::max()));
    block.length = static_cast<std::uint16_t>(length);
    block.continued = i + 1 < needed;
    std::copy_n(bytes.begin(), length, block.bytes.begin());
    bytes = bytes.subspan(length);
    lost_ = 0;
  }

  indices_.publish(needed);
  return true;
}

std::size_t RawRing::pop(std::span<RawBlock> out) ABBE_RT {
  const std::size_t n = indices_.filled_slots(out.size());
  for (std::size_t i = 0; i < n; ++i)
    copy_used(blocks_[indices_.slot(indices_.read_counter() + i)], out[i]);
  if (n != 0) indices_.consume(n);
  return n;
}

}  // namespace abbe::drivers
