#pragma once
/// Status of a stream, for the status command, the journal and the Health topic. Pure data.

#include <optional>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/latency_histogram.hpp"

namespace abbe::daemon {

/// Health of one stream of samples, or of a part of the daemon that is not a device (recorder,
/// models, dds, dds_security).
struct StreamHealth {
  drivers::DeviceStatus status;
  double rate_hz = 0.0;
  double latency_p50_s = 0.0;
  double latency_p99_s = 0.0;
  /// Durations of Device::receive() since the thread started, also of calls without data. The time
  /// from the arrival of data to the return of wait() is not included. Empty if the stream is not a
  /// device.
  drivers::LatencyHistogram::Counts latency{};
  /// for the recorder only: age of the oldest message that is not yet written to the file, s
  std::optional<double> behind_s = {};
};

}  // namespace abbe::daemon
