#include "abbe/sim/line_tracker.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace abbe::sim {
namespace {

using lines::Column;
using lines::TimeUnit;

constexpr int kLengthDigits = 10;  // of the unit: below a nanometre also in m
constexpr int kAngleDigits = 12;   // below a nanoradian also in turns

std::string time_text(DeviceTime t, TimeUnit unit) {
  const std::int64_t ns = t.time_since_epoch().count();
  switch (unit) {
    case TimeUnit::Seconds:
      return fmt::format("{}.{:06}", ns / 1'000'000'000, ns % 1'000'000'000 / 1000);
    case TimeUnit::Milliseconds:
      return fmt::format("{}.{:03}", ns / 1'000'000, ns % 1'000'000 / 1000);
    case TimeUnit::Microseconds:
      return fmt::format("{}", ns / 1000);
    case TimeUnit::Nanoseconds:
      break;
  }
  return fmt::format("{}", ns);
}

std::string column_text(Column column, const lines::LineFormat& format, const Eigen::Vector3d& p,
                        DeviceTime t, bool valid) {
  const auto length = [&](double m) {
    return fmt::format("{:.{}f}", m / format.metres_per_length, kLengthDigits);
  };
  const auto angle = [&](double rad) {
    return fmt::format("{:.{}f}", rad / format.radians_per_angle, kAngleDigits);
  };
  const double elevation = std::atan2(p.z(), std::hypot(p.x(), p.y()));

  switch (column) {
    case Column::Ignored:
      return "T1";
    case Column::X:
      return length(p.x());
    case Column::Y:
      return length(p.y());
    case Column::Z:
      return length(p.z());
    case Column::Range:
      return length(p.norm());
    case Column::Azimuth:
      return angle(std::atan2(p.y(), p.x()));
    case Column::Elevation:
      return angle(elevation);
    case Column::Zenith:
      return angle(std::numbers::pi / 2.0 - elevation);
    case Column::Time:
      return time_text(t, format.time_unit);
    case Column::Status:
      break;
  }
  if (!valid) return "bad";
  return format.valid_status_count == 0 ? "1" : std::string{format.valid_status[0].text()};
}

}  // namespace

std::string print_line(const lines::LineFormat& format, const Eigen::Vector3d& p_tracker_m,
                       DeviceTime t, bool valid) {
  std::string line;
  for (std::size_t i = 0; i < format.column_count; ++i) {
    std::string text = column_text(format.columns[i], format, p_tracker_m, t, valid);
    if (format.decimal_sign != '.') std::ranges::replace(text, '.', format.decimal_sign);
    if (i > 0) line += format.separator;
    line += text;
  }
  return line + "\n";
}

LineTracker::LineTracker(const LineTrackerOptions& options, const VirtualMachine& machine,
                         HostTime now)
    : options_(options), machine_(machine), power_on_(now) {}

void LineTracker::connected(HostTime now) {
  const DeviceTime t = device_time(options_.model, power_on_, now);
  if (!grid_) grid_ = t;
  next_point_ = static_cast<std::uint64_t>((t - *grid_) / options_.separation) + (t > *grid_);
  next_burst_ = now + burst_interval(options_.model.seed, bursts_++);
  if (!first_stream_) first_stream_ = now;
}

void LineTracker::disconnected() {
  next_burst_.reset();
  out_.clear();
}

HostTime LineTracker::next_due() const {
  return next_burst_.value_or(HostTime::max());
}

void LineTracker::advance(HostTime now) {
  while (next_burst_ && *next_burst_ <= now) {
    const HostTime at = *next_burst_;
    next_burst_ = at + burst_interval(options_.model.seed, bursts_++);
    print_burst(at);
  }
}

void LineTracker::print_burst(HostTime at) {
  const DeviceTime until = device_time(options_.model, power_on_, at - options_.delay);
  for (;; ++next_point_) {
    const DeviceTime t =
        *grid_ + options_.separation * static_cast<std::chrono::nanoseconds::rep>(next_point_);
    if (t > until) return;
    const HostTime measured = host_time(options_.model, power_on_, t);
    if (beam_broken_.holds(measured)) continue;
    const TrackerView view = observe(options_.model, machine_, measured, next_point_);
    if (!view.has_target || at < mute_until_) continue;
    const bool valid = !invalid_.holds(measured) && view.speed != BeamSpeed::Exceeded;
    out_ += print_line(options_.format, view.p_tracker_m, t, valid);
    ++points_sent_;
  }
}

std::string LineTracker::take_output() {
  if (next_burst_ && *next_burst_ <= stall_until_) return {};
  return std::exchange(out_, {});
}

bool LineTracker::take_hang_up() {
  return std::exchange(hang_up_, false);
}

void LineTracker::inject(const Fault& fault, HostTime now) {
  advance(now);
  const HostTime until = now + seconds_to_ns(fault.duration_s);
  switch (fault.kind) {
    case FaultKind::BeamBreak:
    case FaultKind::ReflectorAway:
      beam_broken_ = {now, until};
      return;
    case FaultKind::SpeedExceeded:
    case FaultKind::PrismError:
      invalid_ = {now, until};
      return;
    case FaultKind::Stall:
      stall_until_ = until;
      return;
    case FaultKind::Mute:
      mute_until_ = until;
      return;
    case FaultKind::Disconnect:
      hang_up_ = true;
      return;
    case FaultKind::TrackerGarbage:
      out_ += "no line 1 of any tracker\n";
      return;
    default:
      return;  // not a fault of a program that prints lines
  }
}

}  // namespace abbe::sim
