#include "abbe/sim/line_tracker.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace abbe::sim {
namespace {

using lines::Column;

constexpr int kLengthDigits = 10;  // of the unit: below a nanometre also in m
constexpr int kAngleDigits = 12;   // below a nanoradian also in turns

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
  return status_text(format, valid);
}

}  // namespace

std::string print_line(const lines::LineFormat& format, const Eigen::Vector3d& p_tracker_m,
                       DeviceTime t, bool valid) {
  return printed(format, [&](std::size_t i) {
    return column_text(format.columns[i], format, p_tracker_m, t, valid);
  });
}

LineTracker::LineTracker(const LineTrackerOptions& options, const VirtualMachine& machine,
                         HostTime now)
    : LineSource({.clock = clock_of(options.model),
                  .delay = options.delay,
                  .separation = options.separation,
                  .seed = options.model.seed},
                 now),
      options_(options),
      machine_(machine) {}

std::string LineTracker::print(const Instant& instant) const {
  if (beam_broken_.holds(instant.measured)) return {};
  const TrackerView view = observe(options_.model, machine_, instant.measured, instant.index);
  if (!view.has_target) return {};
  const bool valid =
      instant.valid && !too_fast_.holds(instant.measured) && view.speed != BeamSpeed::Exceeded;
  return print_line(options_.format, view.p_tracker_m, instant.shown, valid);
}

void LineTracker::inject_own(const Fault& fault, HostTime now, HostTime until) {
  if (fault.kind == FaultKind::BeamBreak || fault.kind == FaultKind::ReflectorAway)
    beam_broken_ = {now, until};
  if (fault.kind == FaultKind::SpeedExceeded) too_fast_ = {now, until};
}

}  // namespace abbe::sim
