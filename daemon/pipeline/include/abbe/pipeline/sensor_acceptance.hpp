#pragma once
/// A person states that a sensor whose readings are refused is right. Its history is then
/// discarded:
/// it is used when its next readings agree with each other. Recorded, so that a replay does the
/// same.

#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

struct SensorAcceptance {
  std::string sensor;
  protocol::HostTime from{};  ///< applies to readings that are due later (SensorQueue)
  std::string who, why;
};

/// Name of the attachment in the recording.
inline constexpr std::string_view kSensorAcceptedName = "sensor-accepted.json";
[[nodiscard]] RecordingAttachment to_attachment(const SensorAcceptance& acceptance);
/// Error BadInput if the attachment cannot be read.
[[nodiscard]] Result<SensorAcceptance> sensor_acceptance_from(
    const RecordingAttachment& attachment);

}  // namespace abbe::daemon
