// The real-time part of a tracker that sends lines: converts the bytes that wait() read to samples.
#include <span>
#include <utility>

#include "abbe/drivers/lines/tracker_device.hpp"

namespace abbe::drivers {

void LineTrackerDevice::receive() ABBE_RT {
  using Direction = protocol::RawBlock::Direction;
  if (std::exchange(began_, false)) {
    raw_.push_bytes(arrival_, Direction::FromDevice, {});
    receiver_.push({}, arrival_);
  }
  auto rest = std::span<const std::byte>{buffer_}.first(filled_);
  for (std::size_t i = 0; i < read_count_; ++i) {
    const auto bytes = rest.first(read_sizes_[i]);
    rest = rest.subspan(bytes.size());
    raw_.push_bytes(arrival_, Direction::FromDevice, bytes);
    receiver_.push(bytes, arrival_);

    for (auto points = receiver_.next(); !points.empty(); points = receiver_.next()) {
      points_.push(points);
      board_.samples.add(points.size());
      board_.set_last_sample(points.back().head.time);
      board_.set_clock(receiver_.clock());
      board_.set_connected(true);
    }
  }
  discard_reads();

  const std::uint64_t gaps = receiver_.counters().times.gaps;
  board_.gaps.add(gaps - std::exchange(gaps_seen_, gaps));
}

}  // namespace abbe::drivers
