#pragma once
/// The request for a calibration. It arrives over the control socket and is recorded as an
/// attachment beside the samples, so that a replay uses the same request.

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

/// The request of any one method.
using CalibrationTask = Methods::Request;
[[nodiscard]] std::string_view method_of(const CalibrationTask& task) noexcept;  ///< "otf", "evemu"

struct CalibrationRequest {
  CalibrationTask task;
  protocol::HostTime from{};  ///< snapshots before this instant are not used
};

/// The JSON object {"method": ..., members of the method's request}. Numbers are written without
/// loss.
[[nodiscard]] nlohmann::json to_json(const CalibrationTask& task);
/// Reads a request. BadInput names a member that is missing or of the wrong type; Usage for an
/// unknown method. Optional members that `object` does not contain get their values from `config`,
/// or the default values if `config` is null.
[[nodiscard]] Result<CalibrationTask> task_from_json(const nlohmann::json& object,
                                                     const Config* config = nullptr);

[[nodiscard]] RecordingAttachment to_attachment(const CalibrationRequest& request);
/// Makes the attachment for a recording in two steps, so that the hub has little to do:
/// to_attachment() is O(size of the task), set_from() only replaces the start time and is O(1).
[[nodiscard]] RecordingAttachment to_attachment(const CalibrationTask& task);
void set_from(RecordingAttachment& attachment, protocol::HostTime from) noexcept;
[[nodiscard]] Result<CalibrationRequest> from_attachment(const RecordingAttachment& attachment);

}  // namespace abbe::daemon
