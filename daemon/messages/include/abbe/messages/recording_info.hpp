#pragma once
/// What a recording says about itself, written by the Recorder at the front of every file and given
/// back by the RecordingReader. Pure data; safe to copy between threads.

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// MCAP metadata records "abbe.recording" (machine, utc_offset_ns, speed, part, follows),
/// "abbe.configuration" (text, sha256) and "abbe.versions", each with entries_sha256 over all its
/// other entries.
struct RecordingInfo {
  std::string machine;
  protocol::UtcOffset utc_offset;  ///< dates in the file = host time + this
  double speed = 1.0;  ///< host time = speed x CLOCK_MONOTONIC; not 1 only with simulated devices
  std::string configuration;  ///< the text of abbed.toml as it was read
  std::vector<std::pair<std::string, std::string>>
      versions;  ///< "abbe", "fastcdr", a device's firmware ...
};

/// A file kept inside a recording, so that it explains itself: the commanded path of a calibration,
/// for example.
struct RecordingAttachment {
  std::string name;        ///< "path.csv"
  std::string media_type;  ///< "text/csv"
  std::string content;
};

/// Of the attachment that holds what a calibration was asked for: "calibration-otf.json",
/// "calibration-evemu.json".
inline constexpr std::string_view kRequestNamePrefix = "calibration-", kRequestNameSuffix = ".json";
[[nodiscard]] constexpr bool is_calibration_request(std::string_view attachment_name) noexcept {
  return attachment_name.starts_with(kRequestNamePrefix) &&
         attachment_name.ends_with(kRequestNameSuffix);
}

}  // namespace abbe::daemon
