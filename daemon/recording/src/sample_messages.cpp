#include "sample_messages.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace abbe::daemon::recording {
namespace {

using std::chrono::nanoseconds;

protocol::HostTime host_time(std::int64_t ns) {
  return protocol::HostTime{nanoseconds{ns}};
}
std::int64_t ns_of(protocol::HostTime t) {
  return t.time_since_epoch().count();
}

using Axes = std::array<double, protocol::kMaxAxes>;

std::ptrdiff_t axes_of(std::uint8_t axis_count) {
  return std::min<std::ptrdiff_t>(axis_count, protocol::kMaxAxes);
}
/// Copies all values of `from`; the remaining elements of `to` are not changed (they are zero in a
/// new sample).
void copy(const std::vector<double>& from, Axes& to) {
  std::copy_n(from.begin(), std::min(from.size(), to.size()), to.begin());
}

}  // namespace

void fill(v1::TrackerPoint& message, const protocol::TrackerPoint& point, std::string_view device) {
  message.device().assign(device);
  message.host_time_ns(ns_of(point.head.time));
  message.u_time_ns(point.head.u_time.count());
  message.device_time_ns(point.device_time.time_since_epoch().count());
  message.flags(point.head.flags);
  message.lost_before(point.head.lost_before);
  message.device_status(point.device_status);
  message.p_tracker_m(point.p_tracker_m);
}

void fill(v1::AxisSample& message, const protocol::AxisSample& sample, std::string_view device) {
  const auto axes = std::min<std::ptrdiff_t>(sample.axis_count, protocol::kMaxAxes);
  message.device().assign(device);
  message.host_time_ns(ns_of(sample.head.time));
  message.u_time_ns(sample.head.u_time.count());
  message.flags(sample.head.flags);
  message.lost_before(sample.head.lost_before);
  message.cycle(sample.cycle);
  message.missing_mask(sample.missing_mask);
  message.counts().assign(sample.count.begin(), sample.count.begin() + axes);
  message.position().assign(sample.position.begin(), sample.position.begin() + axes);
}

void fill(v1::ProbeTrigger& message, const protocol::ProbeTrigger& touch, std::string_view device) {
  const auto axes = axes_of(touch.axis_count);
  const auto assign = [axes](std::vector<double>& to, const Axes& from) {
    to.assign(from.begin(), from.begin() + axes);
  };

  message.device().assign(device);
  message.host_time_ns(ns_of(touch.head.time));
  message.u_time_ns(touch.head.u_time.count());
  message.flags(touch.head.flags);
  message.lost_before(touch.head.lost_before);
  message.touch(touch.touch);
  message.probe(touch.probe);
  message.latch(static_cast<std::uint8_t>(touch.latch));
  message.touch_flags(touch.touch_flags);
  message.edge_clock_count(touch.edge_clock_count);
  message.missing_mask(touch.missing_mask);
  message.speed_m_s(touch.speed_m_s);
  assign(message.position(), touch.position);
  assign(message.velocity(), touch.velocity);
  assign(message.u_position(), touch.u_position);
  assign(message.U95_position(), touch.U95_position);
}

void fill(v1::TouchScan& message, const protocol::TouchScan& scan, std::string_view device) {
  const auto axes = axes_of(scan.axis_count);
  message.device().assign(device);
  message.host_time_ns(ns_of(scan.head.time));
  message.u_time_ns(scan.head.u_time.count());
  message.flags(scan.head.flags);
  message.lost_before(scan.head.lost_before);
  message.touch(scan.touch);
  message.missing_mask(scan.missing_mask);
  message.clock_count(scan.clock_count);
  message.latch_count(scan.latch_count);
  message.edge_count(scan.edge_count);
  message.counts().assign(scan.count.begin(), scan.count.begin() + axes);
  message.position().assign(scan.position.begin(), scan.position.begin() + axes);
}

void fill(v1::EnvironmentSample& message, const protocol::EnvironmentSample& sample,
          std::string_view device) {
  message.device().assign(device);
  message.host_time_ns(ns_of(sample.head.time));
  message.flags(sample.head.flags);
  message.air_temperature_K(sample.air_temperature_K);
  message.air_pressure_Pa(sample.air_pressure_Pa);
  message.relative_humidity(sample.relative_humidity);
  message.measured(sample.measured);
  message.temperature_K(sample.temperature_K);
}

protocol::TrackerPoint sample_of(const v1::TrackerPoint& message) {
  protocol::TrackerPoint point;
  point.head = {host_time(message.host_time_ns()), nanoseconds{message.u_time_ns()},
                message.flags(), message.lost_before()};
  point.device_time = protocol::DeviceTime{nanoseconds{message.device_time_ns()}};
  point.p_tracker_m = message.p_tracker_m();
  point.device_status = message.device_status();
  return point;
}

protocol::AxisSample sample_of(const v1::AxisSample& message) {
  protocol::AxisSample sample;
  sample.head = {host_time(message.host_time_ns()), nanoseconds{message.u_time_ns()},
                 message.flags(), message.lost_before()};
  sample.cycle = message.cycle();
  sample.missing_mask = message.missing_mask();
  const std::size_t axes =
      std::min({message.counts().size(), message.position().size(), protocol::kMaxAxes});
  sample.axis_count = static_cast<std::uint8_t>(axes);
  std::copy_n(message.counts().begin(), axes, sample.count.begin());
  std::copy_n(message.position().begin(), axes, sample.position.begin());
  return sample;
}

protocol::ProbeTrigger sample_of(const v1::ProbeTrigger& message) {
  protocol::ProbeTrigger touch;
  touch.head = {host_time(message.host_time_ns()), nanoseconds{message.u_time_ns()},
                message.flags(), message.lost_before()};
  touch.touch = message.touch();
  touch.probe = message.probe();
  touch.latch = static_cast<protocol::TouchLatch>(std::min<std::uint8_t>(message.latch(), 2));
  touch.touch_flags = message.touch_flags();
  touch.edge_clock_count = message.edge_clock_count();
  touch.missing_mask = message.missing_mask();
  touch.speed_m_s = message.speed_m_s();
  touch.axis_count =
      static_cast<std::uint8_t>(std::min(message.position().size(), protocol::kMaxAxes));
  copy(message.position(), touch.position);
  copy(message.velocity(), touch.velocity);
  copy(message.u_position(), touch.u_position);
  copy(message.U95_position(), touch.U95_position);

  return touch;
}

protocol::TouchScan sample_of(const v1::TouchScan& message) {
  protocol::TouchScan scan;
  scan.head = {host_time(message.host_time_ns()), nanoseconds{message.u_time_ns()}, message.flags(),
               message.lost_before()};
  scan.touch = message.touch();
  scan.missing_mask = message.missing_mask();
  scan.clock_count = message.clock_count();
  scan.latch_count = message.latch_count();
  scan.edge_count = message.edge_count();
  const std::size_t axes =
      std::min({message.counts().size(), message.position().size(), protocol::kMaxAxes});
  scan.axis_count = static_cast<std::uint8_t>(axes);
  std::copy_n(message.counts().begin(), axes, scan.count.begin());
  std::copy_n(message.position().begin(), axes, scan.position.begin());

  return scan;
}

protocol::EnvironmentSample sample_of(const v1::EnvironmentSample& message) {
  protocol::EnvironmentSample sample;
  sample.head.time = host_time(message.host_time_ns());
  sample.head.flags = message.flags();
  sample.air_temperature_K = message.air_temperature_K();
  sample.air_pressure_Pa = message.air_pressure_Pa();
  sample.relative_humidity = message.relative_humidity();
  sample.measured = message.measured();
  sample.temperature_K = message.temperature_K();
  return sample;
}

}  // namespace abbe::daemon::recording
