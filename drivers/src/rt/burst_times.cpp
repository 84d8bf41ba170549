#include "abbe/drivers/tracker/burst_times.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace abbe::drivers {

using protocol::SampleFlag;

namespace {

/// Points measured before a beam break may arrive after its report. The beam has returned at the
/// first point after a gap of at least this duration, and of at least three point separations.
constexpr std::chrono::milliseconds kShortestBreak{20};
/// Longest delay of a point, for example by a stalled network; a controller stores points for less
/// time. A point that would be later than this has a wrong time.
constexpr std::chrono::minutes kLongestDelay{1};

}  // namespace

template <class Point>
void BurstTimesOf<Point>::connection_began() ABBE_RT {
  clock_.reset();
  times_.reset();
  last_.reset();
  beam_lost_ = false;
  pending_flags_ = static_cast<protocol::SampleFlags>(SampleFlag::Restarted);
}

template <class Point>
void BurstTimesOf<Point>::beam_lost() ABBE_RT {
  if (beam_lost_) return;
  beam_lost_ = true;
  ++counters_.beam_losses;
}

template <class Point>
void BurstTimesOf<Point>::assign(Points points, protocol::HostTime arrival) ABBE_RT {
  arrival_ = arrival;
  for (std::size_t first = 0; first < points.size();) {
    const std::size_t end = judge(points, first);
    convert(points, first, end);
    if (end < points.size()) begin_time_base();
    first = end;
  }
}

template <class Point>
void BurstTimesOf<Point>::assign_mean(Point& point, std::chrono::nanoseconds duration,
                                      protocol::HostTime arrival) ABBE_RT {
  const auto delay = clock_options_.max_constant_delay;
  const double u_ns =
      std::hypot(static_cast<double>(duration.count()), static_cast<double>(delay.count())) /
      (2.0 * std::numbers::sqrt3);
  point.head.time = arrival - (duration + delay) / 2;
  point.head.u_time = std::chrono::nanoseconds{std::llround(u_ns)};
  if (beam_lost_) point.head.flags |= SampleFlag::BeamReturned;
  beam_lost_ = false;
  mark_pending(point.head);
}

/// Without observations the clock model accepts any time: then a large step within the burst shows
/// it.
template <class Point>
bool BurstTimesOf<Point>::is_ahead(protocol::DeviceTime t) const ABBE_RT {
  if (clock_.is_ahead(t, arrival_)) return true;
  return !clock_.has_observations() && times_.known() &&
         t - times_.last() > DeviceTimeCheck::kLargestStep;
}

/// Judges the points from `first` on, up to the first one on a new time base; returns its index, or
/// the number of points. The points that were refused until the new base was certain belong to it.
template <class Point>
std::size_t BurstTimesOf<Point>::judge(Points points, std::size_t first) ABBE_RT {
  for (std::size_t k = first; k < points.size(); ++k) {
    const auto t = points[k].device_time;
    verdicts_[k] = times_.judge(t, is_ahead(t));
    if (verdicts_[k] != Verdict::Jumped) continue;
    const std::size_t agreed_before = DeviceTimeCheck::kAgreeing - 1;
    std::size_t begin = k;
    while (begin > first && k - begin < agreed_before && verdicts_[begin - 1] == Verdict::Refused)
      --begin;
    return begin;
  }
  return points.size();
}

/// The tracker's clock has jumped: a new clock model begins with the next point.
template <class Point>
void BurstTimesOf<Point>::begin_time_base() ABBE_RT {
  times_.reset();
  clock_.restart();
  last_.reset();
  ++counters_.time_jumps;
  pending_flags_ |= SampleFlag::Restarted | SampleFlag::GapBefore;
}

/// Converts points of one time base. The last one that was not refused updates the clock model.
template <class Point>
void BurstTimesOf<Point>::convert(Points points, std::size_t first, std::size_t end) ABBE_RT {
  for (std::size_t k = end; k-- > first;) {
    if (verdicts_[k] != Verdict::Follows) continue;
    if (clock_.observe(points[k].device_time, arrival_) == ClockModel::Observed::Restarted) {
      last_.reset();
      pending_flags_ |= SampleFlag::Restarted;
    }
    break;
  }

  for (std::size_t k = first; k < end; ++k) {
    set_time(points[k]);
    if (verdicts_[k] == Verdict::Refused) {
      refuse(points[k]);
    } else {
      follow(points[k]);
      mark_pending(points[k].head);
    }
  }
}

template <class Point>
void BurstTimesOf<Point>::set_time(Point& point) const ABBE_RT {
  const HostInstant instant = clock_.to_host(point.device_time);
  point.head.time = instant.time;
  point.head.u_time = instant.u_time;
  if (!instant.settled) point.head.flags |= SampleFlag::ClockUnsettled;
}

/// The time of the point does not fit those of the others. Its instant is then not known: it gets
/// its arrival, so that it does not lie in the future or hours ago.
template <class Point>
void BurstTimesOf<Point>::refuse(Point& point) ABBE_RT {
  ++counters_.time_disorder;
  point.head.flags |= SampleFlag::PointInvalid;
  const auto early = arrival_ - point.head.time;
  if (early >= -clock_options_.jump && early <= kLongestDelay) return;
  point.head.time = arrival_;
  point.head.u_time = kLongestDelay;
}

/// Compares the point with the previous one: a gap in the device time means lost points or a lost
/// beam.
template <class Point>
void BurstTimesOf<Point>::follow(Point& point) ABBE_RT {
  if (last_) mark_hole(point.device_time - *last_, point);
  last_ = point.device_time;
}

template <class Point>
void BurstTimesOf<Point>::mark_hole(std::chrono::nanoseconds since_last, Point& point) ABBE_RT {
  if (beam_lost_ &&
      since_last >= std::max<std::chrono::nanoseconds>(kShortestBreak, 3 * separation_)) {
    beam_lost_ = false;
    point.head.flags |= SampleFlag::BeamReturned;
    return;
  }
  if (separation_.count() == 0 || 2 * since_last <= 3 * separation_) return;
  ++counters_.gaps;
  point.head.flags |= SampleFlag::GapBefore;
  point.head.lost_before = static_cast<std::uint32_t>(
      std::min<std::int64_t>((since_last + separation_ / 2) / separation_ - 1, INT32_MAX));
}

template <class Point>
void BurstTimesOf<Point>::mark_pending(protocol::SampleHead& head) ABBE_RT {
  head.flags |= pending_flags_;
  pending_flags_ = 0;
}

template class BurstTimesOf<protocol::TrackerPoint>;
template class BurstTimesOf<TimedHead>;

}  // namespace abbe::drivers
