#pragma once
/// Parses the JSON of an attachment of a recording. The limit of 64 MiB is enough for the largest
/// attachment, a requested path: 10^5 vertices are 7 MB.

#include "abbe/base/bounded_json.hpp"
#include "abbe/messages/recording_info.hpp"

namespace abbe::daemon {

[[nodiscard]] inline Result<nlohmann::json> content_of(const RecordingAttachment& attachment) {
  return parse_json(attachment.content, "attachment " + attachment.name, {.bytes = 64u << 20});
}

}  // namespace abbe::daemon
