#include "abbe/drivers/clock_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace abbe::drivers {
namespace {

constexpr std::chrono::hours kNothingKnown{1};
/// A-priori value of the lateness of an arrival (its delay above the smallest delay), s; it counts
/// as much as one arrival.
constexpr double kPriorLateness_s = 0.020;
/// If arrivals are late for longer than this, the device clock has jumped: a stalled network
/// recovers within milliseconds.
constexpr std::chrono::seconds kLateForTooLong{5};

double seconds(std::chrono::nanoseconds d) noexcept {
  return 1e-9 * static_cast<double>(d.count());
}
std::chrono::nanoseconds nanoseconds(double s) noexcept {
  return std::chrono::nanoseconds{std::llround(1e9 * s)};
}

}  // namespace

ClockModel::Observed ClockModel::observe(protocol::DeviceTime last_point,
                                         protocol::HostTime arrival) ABBE_RT {
  if (count_ == 0) {
    begin_with(last_point, arrival);
    return Observed::Followed;
  }
  const double device_s = seconds(last_point - origin_device_);
  const Point p{device_s, seconds(arrival - origin_host_) - device_s};
  if (device_s == last_device_s_)
    return Observed::Followed;  // the same instant contains no new information

  if (device_s < last_device_s_ || jumped(p, arrival)) {
    restart();
    begin_with(last_point, arrival);
    return Observed::Restarted;
  }

  last_device_s_ = device_s;
  keep(p);
  fit();

  return Observed::Followed;
}

void ClockModel::begin_with(protocol::DeviceTime last_point, protocol::HostTime arrival) ABBE_RT {
  origin_device_ = last_point;
  origin_host_ = arrival;
  last_device_s_ = 0.0;
  keep({0.0, 0.0});
  fit();
}

bool ClockModel::jumped(const Point& p, protocol::HostTime arrival) ABBE_RT {
  const double lateness_s = p.offset_s - line_at(p.device_s);
  const double jump_s = seconds(options_.jump);
  if (lateness_s < -jump_s) return true;  // the device clock has jumped ahead: no delay is negative
  if (lateness_s < jump_s) {
    late_ = false;
    return false;
  }
  if (!late_) late_since_ = arrival;
  late_ = true;
  return arrival - late_since_ > kLateForTooLong;
}

bool ClockModel::is_ahead(protocol::DeviceTime t, protocol::HostTime arrival) const ABBE_RT {
  if (count_ == 0) return false;
  const double device_s = seconds(t - origin_device_);
  const double offset_s = seconds(arrival - origin_host_) - device_s;
  return offset_s - line_at(device_s) < -seconds(options_.jump);
}

void ClockModel::restart() ABBE_RT {
  reset();
  ++restarts_;
}

void ClockModel::reset() ABBE_RT {
  count_ = 0;
  slope_ = free_slope_ = u_beyond_s_ = 0.0;
  beyond_ = false;
  late_ = false;
}

/// Keeps the lowest point of each slice of the window: the line can touch only such points.
void ClockModel::keep(const Point& p) ABBE_RT {
  forget_before(p.device_s - seconds(options_.window));
  const double slice_s = seconds(options_.window) / static_cast<double>(kPoints - 1);
  if (count_ != 0 &&
      std::floor(points_[count_ - 1].device_s / slice_s) == std::floor(p.device_s / slice_s)) {
    Point& last = points_[count_ - 1];
    if (p.offset_s - slope_ * (p.device_s - last.device_s) < last.offset_s) last = p;
    return;
  }
  points_[count_++] = p;
}

void ClockModel::forget_before(double device_s) ABBE_RT {
  const auto begin = points_.begin();
  const auto end = begin + static_cast<std::ptrdiff_t>(count_);
  auto first = std::find_if(begin, end, [&](const Point& p) { return p.device_s >= device_s; });
  if (first == begin && count_ == kPoints) ++first;
  count_ = static_cast<std::size_t>(std::move(first, end, begin) - begin);
}

void ClockModel::fit() ABBE_RT {
  if (count_ > 1) fit_slope();
  const auto begin = points_.begin();
  const auto end = begin + static_cast<std::ptrdiff_t>(count_);
  const auto height = [this](const Point& p) { return p.offset_s - slope_ * p.device_s; };
  const auto lowest =
      std::min_element(begin, end, [&](auto& a, auto& b) { return height(a) < height(b); });
  pivot_s_ = lowest->device_s;
  offset_s_ = lowest->offset_s;
  if (count_ == 1) quarter_s_ = three_quarters_s_ = pivot_s_;
  judge_lateness();
  judge_skew();
}

/// Lower convex hull by monotone chain ([Andrew 1979]). The slope is that of the chord between the
/// hull's heights at one quarter and at three quarters of the observed time. The alternative is the
/// slope of the hull's edge over the middle. It is better only for exponential delays and a long
/// edge; the chord scatters less (by 10 to 20 %) for every delay distribution that was tried.
void ClockModel::fit_slope() ABBE_RT {
  const std::size_t size = find_hull();
  const double begin_s = points_[0].device_s;
  const double span_s = points_[count_ - 1].device_s - begin_s;
  quarter_s_ = begin_s + 0.25 * span_s;
  three_quarters_s_ = begin_s + 0.75 * span_s;
  free_slope_ = (hull_height(size, three_quarters_s_) - hull_height(size, quarter_s_)) /
                (three_quarters_s_ - quarter_s_);
  slope_ = std::clamp(free_slope_, -options_.max_skew, options_.max_skew);
}

std::size_t ClockModel::find_hull() ABBE_RT {
  const auto turns_down = [](const Point& a, const Point& b, const Point& c) {
    return (b.device_s - a.device_s) * (c.offset_s - a.offset_s) <=
           (b.offset_s - a.offset_s) * (c.device_s - a.device_s);
  };
  std::size_t size = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    while (size >= 2 && turns_down(points_[hull_[size - 2]], points_[hull_[size - 1]], points_[i]))
      --size;
    hull_[size++] = static_cast<std::uint16_t>(i);
  }
  return size;
}

double ClockModel::hull_height(std::size_t hull_size, double device_s) const ABBE_RT {
  std::size_t edge = 0;
  while (edge + 2 < hull_size && points_[hull_[edge + 1]].device_s < device_s) ++edge;
  const Point& a = points_[hull_[edge]];
  const Point& b = points_[hull_[edge + 1]];
  return a.offset_s +
         (device_s - a.device_s) * (b.offset_s - a.offset_s) / (b.device_s - a.device_s);
}

/// Estimates how far the line lies above the true envelope, from the density of arrivals above it:
/// q is the lateness of the tenth arrival above the lowest. If the density increases towards the
/// smallest delay (exponential), the lowest of many arrivals is late by 0.1 q; if it decreases (a
/// point's age in its packet plus an exponential), by 0.3 q. The freedom of the slope adds to both.
/// The line is lowered by q / 2 with the standard uncertainty u = q / 2. Then the error divided by
/// its uncertainty has a root mean square of 0.8 to 1.1 for both distributions and mean jitters of
/// 0.5 to 8 ms (400 runs each). q is an order statistic, so that stalled packets do not affect it.
void ClockModel::judge_lateness() ABBE_RT {
  std::array<double, kPoints> lateness{};
  for (std::size_t i = 0; i < count_; ++i)
    lateness[i] = points_[i].offset_s - line_at(points_[i].device_s);
  const auto begin = lateness.begin();
  const auto end = begin + static_cast<std::ptrdiff_t>(count_);
  const auto middle = begin + static_cast<std::ptrdiff_t>(count_ / 2);
  std::nth_element(begin, middle, end);
  median_lateness_s_ = *middle;
  const auto tenth = begin + static_cast<std::ptrdiff_t>(std::min<std::size_t>(count_ - 1, 10));
  std::nth_element(begin, tenth, end);
  const double n = static_cast<double>(count_);
  lowered_s_ = 0.5 * *tenth;
  u_touch_s_ = std::hypot(0.5 * *tenth, kPriorLateness_s / (n * n));
  const double lever_s = three_quarters_s_ - quarter_s_;
  const double u_limit = options_.max_skew / std::sqrt(3.0);  // rectangular within the bound
  u_slope_ = lever_s > 0.0 ? std::min(u_limit, std::sqrt(2.0) * u_touch_s_ / lever_s) : u_limit;
}

/// Tests whether the unconstrained slope exceeds max_skew. Its standard uncertainty is
///     sqrt(2) u / lever
/// u is as in judge_lateness(), but for the unconstrained line; lever is the device time between
/// the two heights of the chord. An excess of more than twice this uncertainty is not random: good
/// clocks stay well within the bound. Then the points are off the constrained line by up to the
/// excess times the window.
void ClockModel::judge_skew() ABBE_RT {
  constexpr double kNoChance = 2.0;
  const double excess = std::abs(free_slope_) - options_.max_skew;
  const double lever_s = three_quarters_s_ - quarter_s_;
  if (excess <= 0.0 || lever_s <= 0.0) {
    beyond_ = false;
  } else if (count_ >= options_.settled_after) {
    beyond_ =
        beyond_ || excess > kNoChance * std::numbers::sqrt2 * u_touch_of_free_line() / lever_s;
  }
  u_beyond_s_ = beyond_ ? excess * (last_device_s_ - points_[0].device_s) : 0.0;
}

double ClockModel::u_touch_of_free_line() const ABBE_RT {
  std::array<double, kPoints> height{};
  for (std::size_t i = 0; i < count_; ++i)
    height[i] = points_[i].offset_s - free_slope_ * points_[i].device_s;
  const auto begin = height.begin();
  const auto end = begin + static_cast<std::ptrdiff_t>(count_);
  const auto tenth = begin + static_cast<std::ptrdiff_t>(std::min<std::size_t>(count_ - 1, 10));
  std::nth_element(begin, tenth, end);
  const double n = static_cast<double>(count_);
  return std::hypot(0.5 * (*tenth - *std::min_element(begin, tenth + 1)),
                    kPriorLateness_s / (n * n));
}

double ClockModel::line_at(double device_s) const ABBE_RT {
  return offset_s_ + slope_ * (device_s - pivot_s_);
}

HostInstant ClockModel::to_host(protocol::DeviceTime t) const ABBE_RT {
  if (count_ == 0) return {protocol::HostTime{}, kNothingKnown, false};
  const double device_s = seconds(t - origin_device_);
  const double bound_s = seconds(options_.max_constant_delay);
  const double outside_s = std::max({0.0, quarter_s_ - device_s, device_s - three_quarters_s_});
  const double u_constant_s =
      bound_s / std::sqrt(12.0);  // standard uncertainty of a rectangle over [0, bound]
  const double u_s =
      std::hypot(std::hypot(u_constant_s, u_touch_s_, u_slope_ * outside_s), u_beyond_s_);
  return {origin_host_ + (t - origin_device_) +
              nanoseconds(line_at(device_s) - lowered_s_ - bound_s / 2.0),
          nanoseconds(u_s), settled()};
}

bool ClockModel::settled() const ABBE_RT {
  return count_ >= options_.settled_after && !late_ && !beyond_;
}

ClockStatus ClockModel::status() const ABBE_RT {
  if (count_ == 0) return {.restarts = restarts_};
  return {.settled = settled(),
          .skew = -slope_,  // offset falls where the device clock runs fast
          .residual = nanoseconds(median_lateness_s_),
          .u_time = to_host(origin_device_ + nanoseconds(last_device_s_)).u_time,
          .restarts = restarts_};
}

}  // namespace abbe::drivers
