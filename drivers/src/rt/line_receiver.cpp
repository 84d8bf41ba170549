#include "abbe/drivers/lines/receiver.hpp"

#include <algorithm>
#include <utility>

namespace abbe::drivers {

using protocol::SampleFlag;
using protocol::TrackerPoint;

LineReceiver::LineReceiver(const LineReceiverOptions& options) noexcept
    : options_(options), times_(options.clock, options.time_separation) {
  if (!options_.datagrams) framer_.resync();
}

void LineReceiver::push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT {
  arrival_ = arrival;
  if (bytes.empty()) return connection_began();
  framer_.push(bytes);
  datagram_ends_ = options_.datagrams;
}

void LineReceiver::connection_began() ABBE_RT {
  framer_.reset();
  if (options_.begins_anywhere) framer_.resync();
  first_line_ = true;
  datagram_ends_ = false;
  times_.connection_began();
  rate_last_.reset();
  rate_steps_ = rate_other_ = 0;
}

void LineReceiver::bytes_lost() ABBE_RT {
  framer_.resync();
  datagram_ends_ = false;
  times_.data_lost();
}

LineCounters LineReceiver::counters() const ABBE_RT {
  LineCounters all = counters_;
  all.times = times_.counters();
  return all;
}

std::span<const TrackerPoint> LineReceiver::next() ABBE_RT {
  count_ = 0;
  while (count_ < points_.size()) {
    const auto line = next_line();
    if (!line) break;
    take(*line);
  }

  const auto points = std::span{points_}.first(count_);
  counters_.points += count_;
  if (options_.format.has(lines::Column::Time)) {
    times_.assign(points, arrival_);
  } else {
    for (TrackerPoint& point : points)
      times_.assign_mean(point, options_.stationary_time, arrival_);
  }
  return points;
}

std::optional<lines::FramedLine> LineReceiver::next_line() ABBE_RT {
  if (const auto line = framer_.next()) return line;
  return std::exchange(datagram_ends_, false) ? framer_.take_incomplete() : std::nullopt;
}

void LineReceiver::take(const lines::FramedLine& line) ABBE_RT {
  const bool first = std::exchange(first_line_, false);
  if (line.too_long) return refuse(line.text, {lines::LineFault::What::TooLong, 0});
  if (lines::is_comment(line.text) || (first && lines::is_heading(line.text))) {
    ++counters_.headings;
    return;
  }
  const auto decoded = lines::decode(line.text, options_.format);
  if (!decoded) return refuse(line.text, decoded.error());

  TrackerPoint& point = points_[count_++];
  point = {};
  point.p_tracker_m = decoded->p_tracker_m;
  point.device_status = decoded->status;
  if (!decoded->valid) point.head.flags |= SampleFlag::PointInvalid;
  if (!decoded->time) return;
  point.device_time = *decoded->time;
  judge_rate(point.device_time);
}

/// A line is lost where one cannot be read: the next point has a gap before it.
void LineReceiver::refuse(std::string_view line, lines::LineFault fault) ABBE_RT {
  ++counters_.unreadable;
  unreadable_.fault = fault;
  unreadable_.length = std::min(line.size(), unreadable_.begin.size());
  std::copy_n(line.begin(), unreadable_.length, unreadable_.begin.begin());
  times_.data_lost();
}

void LineReceiver::judge_rate(protocol::DeviceTime t) ABBE_RT {
  const auto separation = options_.time_separation;
  if (separation.count() == 0) return;
  const auto last = std::exchange(rate_last_, t);
  if (!last || t <= *last) return;
  if (rate_steps_ == 0) rate_begin_ = *last;
  const auto step = t - *last;
  ++rate_steps_;
  if (2 * step <= separation || 2 * step >= 3 * separation) ++rate_other_;
  if (rate_steps_ < kRateCount) return;
  const bool other = 2 * rate_other_ > rate_steps_;
  other_separation_ = other ? (t - rate_begin_) / rate_steps_ : std::chrono::nanoseconds{};
  rate_steps_ = rate_other_ = 0;
}

}  // namespace abbe::drivers
