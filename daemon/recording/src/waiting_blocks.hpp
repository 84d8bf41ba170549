#pragma once
/// Raw blocks of all devices that wait for the recorder. A block takes only as much memory as its
/// bytes: most blocks use a twentieth of the capacity of a RawBlock. The device names must outlive
/// this object.

#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/protocol/raw_bytes_cdr.hpp"

namespace abbe::daemon {

class WaitingBlocks {
 public:
  /// The memory that append() will use for the block.
  [[nodiscard]] static std::size_t bytes_of(const protocol::RawBlock& block) noexcept {
    return sizeof(Head) + block.length;
  }
  /// Appends a block. `dropped`: number of blocks of the same device that were dropped before it;
  /// added to lost_before of the block and then reset to 0.
  void append(protocol::HostTime taken, std::string_view device, const protocol::RawBlock& block,
              std::uint32_t& dropped) {
    const auto from = protocol::to_raw_bytes(block, {}).bytes;
    heads_.push_back({taken, device, block.time, block.lost_before + std::exchange(dropped, 0),
                      block.direction, block.continued, from.size()});
    bytes_.insert(bytes_.end(), from.begin(), from.end());
  }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return heads_.size() * sizeof(Head) + bytes_.size();
  }

  /// Calls sink(const protocol::RawBytes&, taken) for each block, in the order of append().
  template <class Sink>
  void for_each(Sink&& sink) const {
    auto rest = std::span{bytes_};
    for (const Head& head : heads_) {
      sink(protocol::RawBytes{.device = head.device,
                              .time = head.time,
                              .lost_before = head.lost_before,
                              .direction = head.direction,
                              .continued = head.continued,
                              .bytes = rest.first(head.length)},
           head.taken);
      rest = rest.subspan(head.length);
    }
  }
  void clear() noexcept {
    heads_.clear();
    bytes_.clear();
  }

 private:
  struct Head {
    protocol::HostTime taken;
    std::string_view device;
    protocol::HostTime time;
    std::uint32_t lost_before;
    protocol::RawBlock::Direction direction;
    bool continued;
    std::size_t length;
  };
  std::vector<Head> heads_;
  std::vector<std::byte> bytes_;
};

}  // namespace abbe::daemon
