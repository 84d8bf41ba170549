#pragma once
/// Description of a recording. Recorder writes it at the start of every file; RecordingReader
/// returns it. Pure data; safe to copy between threads.

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// The contents of the three metadata records of a recording: MCAP records "abbe.recording"
/// (machine, utc_offset_ns, speed, part, follows), "abbe.configuration" (text, sha256) and
/// "abbe.versions". Each record has an entry entries_sha256, a hash over its other entries.
struct RecordingInfo {
  std::string machine;
  protocol::UtcOffset utc_offset;  ///< UTC in the file = host time + utc_offset
  double speed = 1.0;  ///< host time = speed x CLOCK_MONOTONIC; differs from 1 only in simulation
  std::string configuration;  ///< the text of abbed.toml
  /// name and version: "abbe", "fastcdr", firmware of a device ...
  std::vector<std::pair<std::string, std::string>> versions;
};

/// A file stored inside a recording so that the recording is complete, for example the commanded
/// path of a calibration.
struct RecordingAttachment {
  std::string name;        ///< "path.csv"
  std::string media_type;  ///< "text/csv"
  std::string content;
};

/// The name of the attachment with the request of a calibration: "calibration-otf.json",
/// "calibration-evemu.json".
inline constexpr std::string_view kRequestNamePrefix = "calibration-", kRequestNameSuffix = ".json";
[[nodiscard]] constexpr bool is_calibration_request(std::string_view attachment_name) noexcept {
  return attachment_name.starts_with(kRequestNamePrefix) &&
         attachment_name.ends_with(kRequestNameSuffix);
}

}  // namespace abbe::daemon
