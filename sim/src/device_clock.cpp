#include "abbe/sim/device_clock.hpp"

namespace abbe::sim {

DeviceTime device_time(const DeviceClock& clock, HostTime power_on, HostTime at) {
  // Only the drift is computed as a double, so that the elapsed nanoseconds stay exact.
  const std::chrono::nanoseconds since = at - power_on;
  const auto drift = seconds_to_ns(ns_to_seconds(since) * clock.drift_ppm * 1e-6);
  return DeviceTime{seconds_to_ns(clock.offset_s) + since + drift};
}

HostTime host_time(const DeviceClock& clock, HostTime power_on, DeviceTime at) {
  const std::chrono::nanoseconds on_its_clock =
      at.time_since_epoch() - seconds_to_ns(clock.offset_s);
  const double ppm = clock.drift_ppm * 1e-6;
  return power_on + on_its_clock - seconds_to_ns(ns_to_seconds(on_its_clock) * ppm / (1.0 + ppm));
}

}  // namespace abbe::sim
