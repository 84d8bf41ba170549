#pragma once
/// The clock of a simulated device: its offset and its rate error. Pure.

#include "abbe/protocol/time.hpp"
#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

using protocol::DeviceTime;

struct DeviceClock {
  double offset_s = 12345.0;  ///< reading at power-on
  double drift_ppm = 15.0;    ///< rate error; positive: too fast
};

/// Conversion of host time to the clock of the device and back.
[[nodiscard]] DeviceTime device_time(const DeviceClock& clock, HostTime power_on, HostTime at);
[[nodiscard]] HostTime host_time(const DeviceClock& clock, HostTime power_on, DeviceTime at);

}  // namespace abbe::sim
