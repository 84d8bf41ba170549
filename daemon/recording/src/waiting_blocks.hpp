#pragma once
/// Raw blocks of all devices that wait for the recorder, each with its own length: most are a
/// twentieth of the room a RawBlock has. The names of the devices outlive this.

#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/protocol/raw_bytes_cdr.hpp"

namespace abbe::daemon {

class WaitingBlocks {
 public:
  /// What append() will need for these.
  [[nodiscard]] static std::size_t bytes_of(const protocol::RawBlock& block) noexcept {
    return sizeof(Head) + block.length;
  }
  /// `dropped` blocks before these never came this far: the first one says so.
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

  /// sink(const protocol::RawBytes&, taken), in the order in which they came.
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
