#include "abbe/drivers/interpolation.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/result/try.hpp"

namespace abbe::drivers {
namespace {

using protocol::AxisSample;

double seconds(std::chrono::nanoseconds d) noexcept {
  return 1e-9 * static_cast<double>(d.count());
}

/// The samples before and after an instant, their outer neighbours if these are close enough for
/// the cubic, and the relative place of the instant.
struct Around {
  const AxisSample* before = nullptr;
  const AxisSample* after = nullptr;
  const AxisSample* neighbour_before = nullptr;  ///< null: linear interpolation
  const AxisSample* neighbour_after = nullptr;   ///< null: linear interpolation
  double span_s = 0.0;
  double theta = 0.0;  ///< 0 at `before`, 1 at `after`
};

struct PositionVelocity {
  double position = 0.0;
  double velocity = 0.0;
};

bool answered(const AxisSample* sample, std::size_t axis) noexcept {
  return sample != nullptr && axis < sample->axis_count &&
         ((sample->missing_mask >> axis) & 1u) == 0;
}

double slope(const AxisSample& a, const AxisSample& b, std::size_t axis) noexcept {
  return (b.position[axis] - a.position[axis]) / seconds(b.head.time - a.head.time);
}

/// Derivative at `middle` of the parabola through three samples; their spacing may differ.
double slope_at(const AxisSample& left, const AxisSample& middle, const AxisSample& right,
                std::size_t axis) noexcept {
  const double before_s = seconds(middle.head.time - left.head.time);
  const double after_s = seconds(right.head.time - middle.head.time);
  return (slope(left, middle, axis) * after_s + slope(middle, right, axis) * before_s) /
         (before_s + after_s);
}

PositionVelocity on_line(const Around& s, std::size_t axis) noexcept {
  const double v = slope(*s.before, *s.after, axis);
  return {s.before->position[axis] + v * s.theta * s.span_s, v};
}

/// Cubic Hermite polynomial of theta in [0, 1] with end values p0, p1 and end slopes m0, m1 (per
/// unit of theta).
PositionVelocity on_cubic(const Around& s, std::size_t axis) noexcept {
  const double p0 = s.before->position[axis];
  const double rise = s.after->position[axis] - p0;
  const double m0 = s.span_s * slope_at(*s.neighbour_before, *s.before, *s.after, axis);
  const double m1 = s.span_s * slope_at(*s.before, *s.after, *s.neighbour_after, axis);
  const double c2 = 3.0 * rise - 2.0 * m0 - m1;
  const double c3 = m0 + m1 - 2.0 * rise;
  const double t = s.theta;
  return {p0 + t * (m0 + t * (c2 + t * c3)), (m0 + t * (2.0 * c2 + 3.0 * t * c3)) / s.span_s};
}

double u_of_curve(const Around& s, bool cubic, double max_acceleration) noexcept {
  const double bound = 0.5 * max_acceleration * s.theta * (1.0 - s.theta) * s.span_s * s.span_s;
  return (cubic ? 6.0 / 5.0 : 1.0) * bound / std::sqrt(3.0);
}

tl::expected<Around, InterpolationError> find_around(std::span<const AxisSample> samples,
                                                     protocol::HostTime time,
                                                     std::chrono::nanoseconds max_span) noexcept {
  const auto after =
      std::upper_bound(samples.begin(), samples.end(), time,
                       [](protocol::HostTime t, const AxisSample& s) { return t < s.head.time; });
  if (after == samples.begin()) return tl::unexpected(InterpolationError::TooEarly);
  if (after == samples.end()) return tl::unexpected(InterpolationError::TooLate);
  const auto before = after - 1;
  const auto span = after->head.time - before->head.time;
  if (span > max_span) return tl::unexpected(InterpolationError::Gap);
  Around s{.before = &*before, .after = &*after, .span_s = seconds(span)};
  s.theta = seconds(time - before->head.time) / s.span_s;

  const auto useful = [span](const AxisSample& left, const AxisSample& right) {
    const auto step = right.head.time - left.head.time;
    // The neighbouring interval may be at most 1.2 times as long as the enclosing one: the bound in
    // u_of_curve() is valid up to this ratio.
    return step.count() > 0 && 5 * step <= 6 * span;
  };

  if (before != samples.begin() && useful(*(before - 1), *before))
    s.neighbour_before = &*(before - 1);
  if (after + 1 != samples.end() && useful(*after, *(after + 1))) s.neighbour_after = &*(after + 1);

  return s;
}

}  // namespace

tl::expected<AxesAt, InterpolationError> interpolate_axes(
    std::span<const AxisSample> samples, protocol::HostTime time, std::chrono::nanoseconds u_time,
    const InterpolationOptions& options) noexcept {
  const auto around = find_around(samples, time, options.max_span);
  ABBE_TRY(around);
  AxesAt at;
  at.time = time;
  at.axis_count = std::min(around->before->axis_count, around->after->axis_count);
  at.missing_mask = around->before->missing_mask | around->after->missing_mask;
  at.flags = around->before->head.flags | around->after->head.flags;
  const double u_sample_s =
      seconds(std::max(around->before->head.u_time, around->after->head.u_time));
  const double u_time_s = std::hypot(u_sample_s, seconds(u_time));

  for (std::size_t axis = 0; axis < at.axis_count; ++axis) {
    const bool cubic =
        answered(around->neighbour_before, axis) && answered(around->neighbour_after, axis);
    const auto [position, velocity] = cubic ? on_cubic(*around, axis) : on_line(*around, axis);
    at.position[axis] = position;
    at.velocity[axis] = velocity;
    at.u_position[axis] =
        std::hypot(u_of_curve(*around, cubic, options.max_acceleration[axis]), velocity * u_time_s);
  }

  return at;
}

AxesAt latest_axes(const AxisSample* previous, const AxisSample& latest,
                   const InterpolationOptions& options) noexcept {
  AxesAt at;
  at.time = latest.head.time;
  at.axis_count = latest.axis_count;
  at.missing_mask = latest.missing_mask;
  at.flags = latest.head.flags;
  const auto step =
      previous != nullptr ? latest.head.time - previous->head.time : std::chrono::nanoseconds{0};
  const bool usable = step.count() > 0 && step <= options.max_span;

  for (std::size_t axis = 0; axis < at.axis_count; ++axis) {
    at.position[axis] = latest.position[axis];
    if (!usable || !answered(previous, axis) || !answered(&latest, axis)) continue;
    at.velocity[axis] = slope(*previous, latest, axis);
    at.u_position[axis] = std::abs(at.velocity[axis]) * seconds(latest.head.u_time);
  }

  return at;
}

}  // namespace abbe::drivers
