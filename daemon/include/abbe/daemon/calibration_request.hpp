#pragma once
/// What a calibration was asked for, as it lies in the recording beside the samples, so that a replay is
/// asked the same.

#include <string>
#include <vector>

#include "abbe/daemon/error.hpp"
#include "abbe/daemon/otf_acquisition.hpp"
#include "abbe/daemon/recording_info.hpp"

namespace abbe::daemon {

struct CalibrationRequest {
  std::vector<AxisPosition> path_m;
  protocol::HostTime from{};  ///< snapshots before this instant do not belong to it
};

/// Name of the attachment; its content is JSON and keeps every bit of the numbers.
inline constexpr std::string_view kCalibrationRequestName = "calibration-otf.json";

[[nodiscard]] RecordingAttachment to_attachment(const CalibrationRequest& request);
[[nodiscard]] Result<CalibrationRequest> from_attachment(const RecordingAttachment& attachment);

}  // namespace abbe::daemon
