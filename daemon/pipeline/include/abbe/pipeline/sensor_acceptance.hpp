#pragma once
/// Statement of a person that a sensor is correct although its readings are refused. The history of
/// the sensor is then discarded, and the sensor is used as soon as its next readings agree with
/// each other. The statement is recorded, so that a replay does the same.

#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

struct SensorAcceptance {
  std::string sensor;
  /// applies to readings that become due after this instant (see SensorQueue)
  protocol::HostTime from{};
  std::string who, why;
};

/// Name of the attachment in a recording.
inline constexpr std::string_view kSensorAcceptedName = "sensor-accepted.json";
[[nodiscard]] RecordingAttachment to_attachment(const SensorAcceptance& acceptance);
/// Reads the attachment. Error BadInput if it cannot be read.
[[nodiscard]] Result<SensorAcceptance> sensor_acceptance_from(
    const RecordingAttachment& attachment);

}  // namespace abbe::daemon
