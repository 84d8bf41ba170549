#include "abbe/pipeline/sensor_acceptance.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/messages/attachment_content.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

using nlohmann::json;

RecordingAttachment to_attachment(const SensorAcceptance& acceptance) {
  return {.name = std::string{kSensorAcceptedName},
          .media_type = "application/json",
          .content = json_text(json{{"sensor", acceptance.sensor},
                                    {"from_ns", acceptance.from.time_since_epoch().count()},
                                    {"who", acceptance.who},
                                    {"why", acceptance.why}})};
}

Result<SensorAcceptance> sensor_acceptance_from(const RecordingAttachment& attachment) {
  try {
    const auto j = content_of(attachment);
    ABBE_TRY(j);
    return SensorAcceptance{
        .sensor = j->at("sensor").get<std::string>(),
        .from = protocol::HostTime{std::chrono::nanoseconds{j->at("from_ns").get<std::int64_t>()}},
        .who = j->at("who").get<std::string>(),
        .why = j->at("why").get<std::string>()};
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput,
                fmt::format("attachment {}: {}", attachment.name, cause_of(e)));
  }
}

}  // namespace abbe::daemon
