#pragma once
/// The streams of a recording: one MCAP schema and channel each, with fixed numbers.

#include <array>
#include <cstdint>
#include <string_view>

#include "abbe/messages/cdr.hpp"

namespace abbe::daemon::recording {

enum class Stream : std::uint8_t {
  TrackerPoint,
  AxisSample,
  Environment,
  RawBytes,
  CalibrationEvent,
  ProbeTrigger,
  TouchScan
};
inline constexpr std::size_t kStreamCount = 7;

struct StreamNames {
  std::string_view topic;
  std::string_view type;
};

[[nodiscard]] inline std::array<StreamNames, kStreamCount> stream_names() noexcept {
  return {{{topic_name<v1::TrackerPoint>(), type_name<v1::TrackerPoint>()},
           {topic_name<v1::AxisSample>(), type_name<v1::AxisSample>()},
           {topic_name<v1::EnvironmentSample>(), type_name<v1::EnvironmentSample>()},
           {topic_name<v1::RawBytes>(), type_name<v1::RawBytes>()},
           {topic_name<v1::CalibrationEvent>(), type_name<v1::CalibrationEvent>()},
           {topic_name<v1::ProbeTrigger>(), type_name<v1::ProbeTrigger>()},
           {topic_name<v1::TouchScan>(), type_name<v1::TouchScan>()}}};
}

[[nodiscard]] constexpr std::size_t index(Stream stream) noexcept {
  return static_cast<std::size_t>(stream);
}
/// The channel id, which is also the id of the schema; 0 is not a valid id.
[[nodiscard]] constexpr std::uint16_t channel_id(Stream stream) noexcept {
  return static_cast<std::uint16_t>(index(stream) + 1);
}

inline constexpr std::string_view kRecordingMetadata = "abbe.recording";
/// Entry of the metadata record kRecordingMetadata. In files without this entry, which older
/// versions wrote, log_time is the instant that a message describes, not the time of the hub's
/// cycle.
inline constexpr const char* kLogTime = "log_time";
inline constexpr std::string_view kConfigurationMetadata = "abbe.configuration";
inline constexpr std::string_view kVersionsMetadata = "abbe.versions";

}  // namespace abbe::daemon::recording
