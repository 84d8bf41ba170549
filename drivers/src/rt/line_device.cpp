// The real-time part of a device that sends lines: converts the bytes that wait() read to samples.
#include "abbe/drivers/lines/device.hpp"

#include <span>
#include <utility>

#include "abbe/drivers/lines/session.hpp"

namespace abbe::drivers {

using Direction = protocol::RawBlock::Direction;

std::optional<std::span<const std::byte>> LineSession::next_read() ABBE_RT {
  if (std::exchange(began_, false)) {
    raw_.push_bytes(arrival_, Direction::FromDevice, {});
    return std::span<const std::byte>{};
  }
  if (next_read_ == read_count_) {
    discard_reads();
    return std::nullopt;
  }

  const auto bytes = std::span<const std::byte>{buffer_}.subspan(taken_, read_sizes_[next_read_++]);
  taken_ += bytes.size();
  raw_.push_bytes(arrival_, Direction::FromDevice, bytes);
  return bytes;
}

void LineSession::received(std::size_t samples, protocol::HostTime last,
                           const ClockStatus& clock) ABBE_RT {
  board_.samples.add(samples);
  board_.set_last_sample(last);
  board_.set_clock(clock);
  board_.set_connected(true);
}

void LineSession::count_gaps(std::uint64_t gaps) ABBE_RT {
  board_.gaps.add(gaps - std::exchange(gaps_seen_, gaps));
}

template <class Content>
void LineDevice<Content>::receive() ABBE_RT {
  while (const auto read = session_.next_read()) {
    receiver_.push(*read, session_.arrival());
    for (auto samples = receiver_.next(); !samples.empty(); samples = receiver_.next()) {
      samples_.push(samples);
      session_.received(samples.size(), samples.back().head.time, receiver_.clock());
    }
  }
  session_.count_gaps(receiver_.counters().times.gaps);
}

template void LineDevice<LinePoints>::receive() ABBE_RT;
template void LineDevice<LineAxes>::receive() ABBE_RT;

}  // namespace abbe::drivers
