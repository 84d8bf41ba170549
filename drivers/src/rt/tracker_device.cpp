// The real-time part of the tracker: converts the bytes that wait() read to samples.
#include "abbe/drivers/tracker/device.hpp"

#include <utility>

#include "abbe/protocol/visit.hpp"

namespace abbe::drivers {

using Direction = protocol::RawBlock::Direction;

void TrackerDevice::receive() ABBE_RT {
  if (std::exchange(began_, false)) {
    raw_.push_bytes(arrival_, Direction::FromDevice, {});
    receiver_.push({}, arrival_);
  }
  const auto bytes = received();
  if (bytes.empty()) return;
  raw_.push_bytes(arrival_, Direction::FromDevice, bytes);
  receiver_.push(bytes, arrival_);

  while (const auto message = receiver_.next()) {
    protocol::visit_trivial([this](const auto& m) ABBE_RT { take(m); }, *message);
  }

  const TrackerCounters counters = receiver_.counters();
  const std::uint64_t gaps = counters.gaps + counters.beam_losses;
  board_.gaps.add(gaps - std::exchange(gaps_seen_, gaps));
}

void TrackerDevice::take(const TrackerBurst& burst) ABBE_RT {
  points_.push(burst.points);
  board_.samples.add(burst.points.size());
  board_.set_last_sample(burst.points.back().head.time);
  board_.set_clock(receiver_.clock());
  take(TrackerPointsArrived{burst.points.size()});
}

/// Posts the points of all bursts of a cycle as one message.
void TrackerDevice::take(const TrackerPointsArrived& arrived) ABBE_RT {
  auto* last = last_posted();
  if (auto* points = last == nullptr ? nullptr : std::get_if<TrackerPointsArrived>(last)) {
    points->count += arrived.count;
  } else {
    post(arrived);
  }
}

}  // namespace abbe::drivers
