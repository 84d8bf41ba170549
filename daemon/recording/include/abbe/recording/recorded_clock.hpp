#pragma once
/// What happened to the wall clock while a recording was written. The dates of its messages come
/// from one offset, taken at the start of abbed; an attachment states how far the clock was away
/// from them later.

#include "abbe/base/clock_steps.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/protocol/time.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon {

inline constexpr std::string_view kClockChangeName = "clock-change.json";

/// Replaces the change of an earlier attachment: both are since the start of abbed.
[[nodiscard]] RecordingAttachment to_attachment(const ClockChange& change);

struct RecordedClock {
  protocol::UtcOffset dates;  ///< of samples, by the wall clock as it was at the end
  ClockChange change;         ///< since the start of abbed
};
/// An attachment that cannot be read is ignored.
[[nodiscard]] RecordedClock recorded_clock(const RecordingReader& recording);

}  // namespace abbe::daemon
