#pragma once
/// Changes of the wall clock while a recording was written. The dates of all messages are computed
/// with one offset, which is taken at the start of abbed. An attachment states by how much the
/// clock differed from this offset later.

#include "abbe/base/clock_steps.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/protocol/time.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon {

inline constexpr std::string_view kClockChangeName = "clock-change.json";

/// Makes the attachment. It replaces an earlier one, because both contain the change since the
/// start of abbed.
[[nodiscard]] RecordingAttachment to_attachment(const ClockChange& change);

struct RecordedClock {
  /// converts host times of samples to dates, by the wall clock at the end of the recording
  protocol::UtcOffset dates;
  ClockChange change;  ///< change since the start of abbed
};
/// Reads the attachment. An attachment that cannot be read is ignored.
[[nodiscard]] RecordedClock recorded_clock(const RecordingReader& recording);

}  // namespace abbe::daemon
