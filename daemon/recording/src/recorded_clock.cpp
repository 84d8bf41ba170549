#include "abbe/recording/recorded_clock.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <optional>

#include "abbe/base/bounded_json.hpp"

namespace abbe::daemon {
namespace {

std::optional<ClockChange> change_in(const RecordingAttachment& attachment) {
  const auto read = parse_json(attachment.content, attachment.name,
                               {.bytes = 1u << 12, .depth = 2, .values = 16});
  if (!read || !read->is_object()) return std::nullopt;
  const auto step = read->find("step_ns"), suspended = read->find("suspended_ns");
  if (step == read->end() || suspended == read->end() || !step->is_number_integer() ||
      !suspended->is_number_integer())
    return std::nullopt;
  return ClockChange{std::chrono::nanoseconds{step->get<std::int64_t>()},
                     std::chrono::nanoseconds{suspended->get<std::int64_t>()}};
}

}  // namespace

RecordingAttachment to_attachment(const ClockChange& change) {
  return {std::string{kClockChangeName}, "application/json",
          fmt::format("{{\"step_ns\": {}, \"suspended_ns\": {}}}\n", change.step.count(),
                      change.suspended.count())};
}

RecordedClock recorded_clock(const RecordingReader& recording) {
  RecordedClock clock{.dates = recording.info().utc_offset, .change = {}};
  for (const RecordingAttachment& attachment : recording.attachments())
    if (attachment.name == kClockChangeName)
      clock.change = change_in(attachment).value_or(clock.change);
  clock.dates.value += clock.change.step + clock.change.suspended;
  return clock;
}

}  // namespace abbe::daemon
