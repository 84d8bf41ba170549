#pragma once
/// What a calibration was asked for, as it comes over the control socket and lies in the recording
/// beside the samples, so that a replay is asked the same.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/methods/methods.hpp"

namespace abbe::daemon {

/// One for every method.
using CalibrationTask = Methods::Request;
[[nodiscard]] std::string_view method_of(const CalibrationTask& task) noexcept;  ///< "otf", "evemu"

struct CalibrationRequest {
  CalibrationTask task;
  protocol::HostTime from{};  ///< snapshots before this instant do not belong to it
};

/// {"method": ..., what it needs}; keeps every bit of the numbers.
[[nodiscard]] nlohmann::json to_json(const CalibrationTask& task);
/// BadInput naming what is missing or of the wrong type; Usage for an unknown method. `config`: for
/// what the object leaves to the configuration; null: the defaults.
[[nodiscard]] Result<CalibrationTask> task_from_json(const nlohmann::json& object,
                                                     const Config* config = nullptr);

[[nodiscard]] RecordingAttachment to_attachment(const CalibrationRequest& request);
/// The same in two steps, of which only the first grows with the task.
[[nodiscard]] RecordingAttachment to_attachment(const CalibrationTask& task);
void set_from(RecordingAttachment& attachment, protocol::HostTime from) noexcept;
[[nodiscard]] Result<CalibrationRequest> from_attachment(const RecordingAttachment& attachment);

}  // namespace abbe::daemon
