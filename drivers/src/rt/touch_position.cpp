#include "abbe/drivers/sampling/touch_position.hpp"

#include <array>
#include <cmath>
#include <limits>

#include "abbe/drivers/sampling/coverage.hpp"

namespace abbe::drivers {
namespace {

using protocol::DeviceTime;
using protocol::ProbeTrigger;
using protocol::SampleFlag;
using protocol::TouchFlag;
using std::chrono::nanoseconds;
using Axes = std::array<double, protocol::kMaxAxes>;

// largest interval between neighbouring scans, in scan periods: one scan may be lost
constexpr double kLostScans = 2.5;

double seconds(nanoseconds d) noexcept {
  return 1e-9 * static_cast<double>(d.count());
}

InterpolationOptions interpolation_of(const TouchOptions& options) noexcept {
  InterpolationOptions o;
  o.max_acceleration = options.max_acceleration;
  o.max_span = nanoseconds{
      std::llround(kLostScans * static_cast<double>(options.wiring.scan_period.count()))};
  return o;
}

double norm_of_linear(const Axes& v, std::uint8_t linear_axes) noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < v.size(); ++i)
    if (((linear_axes >> i) & 1u) != 0) sum += v[i] * v[i];
  return std::sqrt(sum);
}

/// Velocity of the approach, and whether its two halves had the same velocity.
struct Approach {
  Axes velocity{};
  double speed = 0.0;
  bool steady = false;
};

Approach approach_to(DeviceTime contact, const ScanHistory::At& at, const ScanHistory& scans,
                     const TouchOptions& options,
                     const InterpolationOptions& interpolation) noexcept {
  const std::uint8_t linear =
      options.wiring.linear_axes & static_cast<std::uint8_t>(~at.axes.missing_mask);
  const nanoseconds half = options.approach.speed_window / 2;
  const auto middle = scans.at(contact - half, interpolation);
  const auto begin = scans.at(contact - 2 * half, interpolation);
  Approach a;

  if (!middle || !begin) {
    a.velocity = at.axes.velocity;
    a.speed = norm_of_linear(a.velocity, linear);
    return a;
  }

  Axes change{};
  for (std::size_t i = 0; i < at.axes.axis_count; ++i) {
    const double later = (at.axes.position[i] - middle->axes.position[i]) / seconds(half);
    const double earlier = (middle->axes.position[i] - begin->axes.position[i]) / seconds(half);
    a.velocity[i] = 0.5 * (later + earlier);
    change[i] = later - earlier;
  }

  a.speed = norm_of_linear(a.velocity, linear);
  a.steady = norm_of_linear(change, linear) <= options.approach.max_speed_change * a.speed;
  return a;
}

protocol::TouchFlags judge(const Approach& approach, const ProbeApproach& rules) noexcept {
  protocol::TouchFlags flags = 0;
  if (approach.speed < rules.min_speed_m_s) flags |= TouchFlag::SpeedTooLow;
  if (approach.speed > rules.max_speed_m_s) flags |= TouchFlag::SpeedTooHigh;
  if (!approach.steady) flags |= TouchFlag::SpeedUnsteady;
  return flags;
}

/// Uncertainty of the instant of contact: half-width of the rectangular part (the edge's interval),
/// and standard uncertainty of all other parts.
struct InstantUncertainty {
  double half_width_s = 0.0;
  double u_s = 0.0;
};

InstantUncertainty uncertainty_of(const EdgeInterval& edge, const ProbeDelay& delay,
                                  double period_s) noexcept {
  const double u_clock_s = period_s / std::sqrt(6.0);  // two rectangles of one period
  return {0.5 * static_cast<double>(edge.to - edge.from) * period_s,
          std::hypot(u_clock_s, seconds(delay.u_jitter), seconds(delay.u_delay))};
}

void state_uncertainty(const InstantUncertainty& instant, const AxesAt& axes,
                       const Axes& resolution, ProbeTrigger& trigger) noexcept {
  for (std::size_t i = 0; i < trigger.axis_count; ++i) {
    const double speed = std::abs(trigger.velocity[i]);
    const double half_width = speed * instant.half_width_s;
    const double rest =
        std::hypot(speed * instant.u_s, axes.u_position[i], resolution[i] / std::sqrt(12.0));
    trigger.u_position[i] = std::hypot(half_width / std::sqrt(3.0), rest);
    trigger.U95_position[i] = expanded_95(half_width, rest);
  }
}

void mark_no_position(const ScanHistory& scans, ProbeTrigger& trigger) noexcept {
  trigger.touch_flags |= TouchFlag::NoPosition;
  trigger.head.flags |= SampleFlag::AxisMissing;
  trigger.position.fill(std::numeric_limits<double>::quiet_NaN());
  trigger.missing_mask = 0xFF;
  if (scans.empty()) return;
  trigger.axis_count = scans.newest().axes.axis_count;
  trigger.head.time = scans.newest().axes.head.time;
}

}  // namespace

ProbeTrigger locate_touch(const EdgeInterval& edge, const ScanHistory& scans,
                          const TouchOptions& options) ABBE_RT {
  ProbeTrigger trigger;
  trigger.probe = options.delay.id;
  trigger.latch = edge.latched ? protocol::TouchLatch::Clock : protocol::TouchLatch::Scan;
  trigger.edge_clock_count = edge.from + (edge.to - edge.from) / 2;
  const DeviceTime from = scans.instant(edge.from);
  const DeviceTime contact = from + (scans.instant(edge.to) - from) / 2 - options.delay.delay;

  const InterpolationOptions interpolation = interpolation_of(options);
  const auto at = scans.at(contact, interpolation);
  if (!at) {
    mark_no_position(scans, trigger);
    return trigger;
  }
  const InstantUncertainty u = uncertainty_of(edge, options.delay, scans.clock_period_s());
  trigger.head.time = at->host_time;
  const auto u_contact = std::llround(1e9 * std::hypot(u.half_width_s / std::sqrt(3.0), u.u_s));
  trigger.head.u_time = nanoseconds{std::llround(
      std::hypot(static_cast<double>(at->u_host_time.count()), static_cast<double>(u_contact)))};
  // A gap or restart between two scans is not one between two touches: its flags are removed.
  trigger.head.flags = at->axes.flags & ~(SampleFlag::GapBefore | SampleFlag::Restarted);
  trigger.axis_count = at->axes.axis_count;
  trigger.missing_mask = at->axes.missing_mask;
  trigger.position = at->axes.position;

  const Approach approach = approach_to(contact, *at, scans, options, interpolation);
  trigger.velocity = approach.velocity;
  trigger.speed_m_s = approach.speed;
  trigger.touch_flags = judge(approach, options.approach);
  state_uncertainty(u, at->axes, options.wiring.resolution, trigger);
  return trigger;
}

}  // namespace abbe::drivers
