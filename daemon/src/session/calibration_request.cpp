#include "abbe/daemon/calibration_request.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace abbe::daemon {

using nlohmann::json;

RecordingAttachment to_attachment(const CalibrationRequest& request) {
  const json content{
      {"method", "otf"}, {"from_ns", request.from.time_since_epoch().count()}, {"path_m", request.path_m}};
  return {.name = std::string{kCalibrationRequestName},
          .media_type = "application/json",
          .content = content.dump()};
}

Result<CalibrationRequest> from_attachment(const RecordingAttachment& attachment) {
  try {
    const json content = json::parse(attachment.content);
    return CalibrationRequest{
        .path_m = content.at("path_m").get<std::vector<AxisPosition>>(),
        .from = protocol::HostTime{std::chrono::nanoseconds{content.at("from_ns").get<std::int64_t>()}}};
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput, fmt::format("attachment {}: {}", attachment.name, e.what()));
  }
}

}  // namespace abbe::daemon
