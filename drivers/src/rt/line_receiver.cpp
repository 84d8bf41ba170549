#include "abbe/drivers/lines/receiver.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace abbe::drivers {

using protocol::SampleFlag;

template <class Content>
void LineReceiverOf<Content>::push(std::span<const std::byte> bytes,
                                   protocol::HostTime arrival) ABBE_RT {
  arrival_ = arrival;
  if (bytes.empty()) return connection_began();
  framer_.push(bytes);
  datagram_ends_ = options_.datagrams;
}

template <class Content>
void LineReceiverOf<Content>::connection_began() ABBE_RT {
  framer_.reset();
  if (options_.begins_anywhere) framer_.resync();
  first_line_ = true;
  datagram_ends_ = false;
  times_.connection_began();
  rate_last_.reset();
  rate_steps_ = rate_other_ = 0;
  last_by_arrival_.reset();
  lines_in_reads_ = reads_with_lines_ = 0;
}

template <class Content>
void LineReceiverOf<Content>::bytes_lost() ABBE_RT {
  framer_.resync();
  datagram_ends_ = false;
  times_.data_lost();
}

template <class Content>
LineReception LineReceiverOf<Content>::findings() const ABBE_RT {
  LineReception all = found_;
  all.counters = counters();
  all.skew_beyond_limit = times_.skew_beyond_limit();
  return all;
}

template <class Content>
LineCounters LineReceiverOf<Content>::counters() const ABBE_RT {
  LineCounters all = found_.counters;
  all.times = times_.counters();
  all.times.gaps += found_.counters.times.gaps;
  return all;
}

template <class Content>
std::span<const typename Content::Sample> LineReceiverOf<Content>::next() ABBE_RT {
  // Where none of the gathered samples is used there may be further lines.
  for (;;) {
    count_ = 0;
    while (count_ < samples_.size()) {
      const auto line = next_line();
      if (!line) break;
      take(*line);
    }
    if (count_ == 0) return {};

    found_.counters.points += count_;
    const std::size_t used = has_time_ ? set_times(count_) : set_times_by_arrival(count_);
    if (used > 0) return std::span{samples_}.first(used);
  }
}

template <class Content>
std::optional<lines::FramedLine> LineReceiverOf<Content>::next_line() ABBE_RT {
  if (const auto line = framer_.next()) return line;
  return std::exchange(datagram_ends_, false) ? framer_.take_incomplete() : std::nullopt;
}

template <class Content>
void LineReceiverOf<Content>::take(const lines::FramedLine& line) ABBE_RT {
  const bool first = std::exchange(first_line_, false);
  if (line.too_long) return refuse(line.text, {lines::LineFault::What::TooLong, 0});
  if (lines::is_comment(line.text) || (first && lines::is_heading(line.text))) {
    ++found_.counters.headings;
    return;
  }
  const auto decoded = lines::decode(line.text, options_.format);
  if (!decoded) return refuse(line.text, decoded.error());

  Sample& sample = samples_[count_];
  sample = {};
  const auto number = static_cast<std::uint32_t>(found_.counters.points + count_);
  Content::fill(*decoded, options_.format, number, sample);
  found_.invalid = Content::kStatusIsCondition && !decoded->valid;

  TimedHead& timed = heads_[count_++];
  timed = {sample.head, decoded->time.value_or(protocol::DeviceTime{})};
  if (decoded->time) judge_rate(timed.device_time);
}

/// A line is lost where one cannot be read: the next sample has a gap before it.
template <class Content>
void LineReceiverOf<Content>::refuse(std::string_view line, lines::LineFault fault) ABBE_RT {
  ++found_.counters.unreadable;
  UnreadableLine& unreadable = found_.unreadable;
  unreadable.fault = fault;
  unreadable.length = std::min(line.size(), unreadable.begin.size());
  std::copy_n(line.begin(), unreadable.length, unreadable.begin.begin());
  times_.data_lost();
}

template <class Content>
void LineReceiverOf<Content>::judge_rate(protocol::DeviceTime t) ABBE_RT {
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
  found_.other_separation = other ? (t - rate_begin_) / rate_steps_ : std::chrono::nanoseconds{};
  rate_steps_ = rate_other_ = 0;
}

/// Returns the number of samples that are used; they are the first ones then.
template <class Content>
std::size_t LineReceiverOf<Content>::set_times(std::size_t count) ABBE_RT {
  times_.assign(std::span{heads_}.first(count), arrival_);
  std::size_t used = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool refused = has(heads_[i].head.flags, SampleFlag::PointInvalid);
    if (refused && !Content::kKeepsRefused) continue;
    if (used != i) samples_[used] = samples_[i];
    samples_[used++].head = heads_[i].head;
  }
  return used;
}

/// As set_times(), for lines without a time.
template <class Content>
std::size_t LineReceiverOf<Content>::set_times_by_arrival(std::size_t count) ABBE_RT {
  std::size_t first = 0;
  if (Content::kNewestOfRead) {
    judge_togetherness(count);
    first = count - 1;
    if (last_by_arrival_ == arrival_) return 0;
  }

  for (std::size_t i = first; i < count; ++i) {
    times_.assign_mean(heads_[i], options_.stationary_time, arrival_);
    mark_gap_of_arrivals(heads_[i]);
    if (first != 0) samples_[i - first] = samples_[i];
    samples_[i - first].head = heads_[i].head;
  }
  return count - first;
}

template <class Content>
void LineReceiverOf<Content>::judge_togetherness(std::size_t count) ABBE_RT {
  lines_in_reads_ += count;
  ++reads_with_lines_;
  if (lines_in_reads_ < kRateCount) return;
  found_.together = lines_in_reads_ >= 2 * reads_with_lines_;
  lines_in_reads_ = reads_with_lines_ = 0;
}

/// Arrivals scatter by the largest delay; more time without a line shows that lines are missing.
template <class Content>
void LineReceiverOf<Content>::mark_gap_of_arrivals(TimedHead& timed) ABBE_RT {
  const auto last = std::exchange(last_by_arrival_, arrival_);
  const auto separation = options_.time_separation;
  if (!last || separation.count() == 0) return;
  const auto missing = arrival_ - *last - options_.clock.max_constant_delay;
  if (2 * missing <= 3 * separation) return;
  ++found_.counters.times.gaps;
  timed.head.flags |= SampleFlag::GapBefore;
  timed.head.lost_before =
      static_cast<std::uint32_t>(std::min<std::int64_t>(missing / separation, INT32_MAX));
}

template class LineReceiverOf<LinePoints>;
template class LineReceiverOf<LineAxes>;

}  // namespace abbe::drivers
