#include "recording/sample_messages.hpp"

#include <algorithm>

namespace abbe::daemon::recording {
namespace {

using std::chrono::nanoseconds;

protocol::HostTime host_time(std::int64_t ns) {
  return protocol::HostTime{nanoseconds{ns}};
}
std::int64_t ns_of(protocol::HostTime t) {
  return t.time_since_epoch().count();
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
  point.head = {host_time(message.host_time_ns()), nanoseconds{message.u_time_ns()}, message.flags(),
                message.lost_before()};
  point.device_time = protocol::DeviceTime{nanoseconds{message.device_time_ns()}};
  point.p_tracker_m = message.p_tracker_m();
  point.device_status = message.device_status();
  return point;
}

protocol::AxisSample sample_of(const v1::AxisSample& message) {
  protocol::AxisSample sample;
  sample.head = {host_time(message.host_time_ns()), nanoseconds{message.u_time_ns()}, message.flags(),
                 message.lost_before()};
  sample.cycle = message.cycle();
  sample.missing_mask = message.missing_mask();
  const std::size_t axes = std::min({message.counts().size(), message.position().size(), protocol::kMaxAxes});
  sample.axis_count = static_cast<std::uint8_t>(axes);
  std::copy_n(message.counts().begin(), axes, sample.count.begin());
  std::copy_n(message.position().begin(), axes, sample.position.begin());
  return sample;
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
