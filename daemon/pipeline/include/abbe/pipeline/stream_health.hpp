#pragma once
/// What a stream is in, for status, journal and Health. Pure data.

#include "abbe/drivers/device.hpp"

namespace abbe::daemon {

/// Health of one stream, device or not.
struct StreamHealth {
  drivers::DeviceStatus status;
  double rate_hz = 0.0;
  double latency_p50_s = 0.0;
  double latency_p99_s = 0.0;
};

}  // namespace abbe::daemon
