// Converts the state of SensorChecks to and from an attachment of a recording.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/messages/attachment_content.hpp"
#include "abbe/pipeline/sensor_checks.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;
using std::chrono::nanoseconds;

/// A number with all its digits; null for NaN, which JSON does not have.
json json_of(double value) {
  return std::isnan(value) ? json{} : json(value);
}
double double_of(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

/// The doubt with this number. For an unknown number, which another version wrote, the next reading
/// is judged without a doubt.
calib::SensorDoubt doubt_of(int number) {
  const bool known = number >= 0 && number <= static_cast<int>(calib::SensorDoubt::Others);
  return known ? static_cast<calib::SensorDoubt>(number) : calib::SensorDoubt::None;
}

json json_of(const calib::SensorTrack& track) {
  return {{"has_history", track.has_history},
          {"reference", json_of(track.reference)},
          {"at_ns", track.at.count()},
          {"agreed", track.agreed},
          {"doubted_since_ns", track.doubted_since ? json(track.doubted_since->count()) : json{}},
          {"slack", json_of(track.slack)}};
}

nanoseconds time_of(const json& ns) {
  return nanoseconds{ns.get<std::int64_t>()};
}

calib::SensorTrack track_of(const json& j) {
  calib::SensorTrack track{.has_history = j.at("has_history").get<bool>(),
                           .reference = double_of(j.at("reference")),
                           .at = time_of(j.at("at_ns")),
                           .agreed = j.at("agreed").get<int>(),
                           .slack = double_of(j.at("slack"))};
  if (!j.at("doubted_since_ns").is_null()) track.doubted_since = time_of(j.at("doubted_since_ns"));
  return track;
}

}  // namespace

RecordingAttachment SensorChecks::to_attachment() const {
  json all = json::array();
  for (const Sensor& s : sensors_)
    all.push_back({{"sensor", s.options.name},
                   {"device", s.options.device},
                   {"track", json_of(s.track)},
                   {"held", json_of(s.held.value)},
                   {"held_at_ns", s.held.at.count()},
                   {"applied", json_of(s.applied.value)},
                   {"applied_at_ns", s.applied.at.count()},
                   {"usable", json_of(s.usable)},
                   {"used", json_of(s.used)},
                   {"twin_differs", s.twin_differs},
                   {"twins_doubted", s.twins_doubted},
                   {"at_ns", s.at.count()},
                   {"judged", s.judged},
                   {"accepted", s.accepted},
                   {"doubt", static_cast<int>(s.doubt)},
                   {"reading", json_of(s.reading)},
                   {"lowest", json_of(s.lowest)},
                   {"highest", json_of(s.highest)}});
  return {.name = std::string{kSensorStateName},
          .media_type = "application/json",
          .content = json_text(all)};
}

Result<void> SensorChecks::go_on(const RecordingAttachment& attachment) {
  try {
    const auto parsed = content_of(attachment);
    ABBE_TRY(parsed);
    for (const json& j : *parsed) {
      for (Sensor& s : sensors_) {
        if (s.options.name != j.at("sensor").get<std::string>() ||
            s.options.device != j.at("device").get<std::string>())
          continue;
        s.track = track_of(j.at("track"));
        s.held = {double_of(j.at("held")), time_of(j.at("held_at_ns"))};
        s.applied = {double_of(j.at("applied")), time_of(j.at("applied_at_ns"))};
        s.usable = double_of(j.at("usable"));
        s.used = double_of(j.at("used"));
        s.twin_differs = j.at("twin_differs").get<int>();
        s.twins_doubted = j.at("twins_doubted").get<bool>();
        s.at = time_of(j.at("at_ns"));
        s.judged = j.at("judged").get<bool>();
        s.accepted = j.at("accepted").get<bool>();
        s.doubt = doubt_of(j.at("doubt").get<int>());
        s.reading = double_of(j.at("reading"));
        s.lowest = double_of(j.at("lowest"));
        s.highest = double_of(j.at("highest"));
        if (!s.options.twin) {  // the configuration of the earlier run may have had a twin
          s.twin_differs = 0;
          s.twins_doubted = false;
          if (s.doubt == calib::SensorDoubt::Twin) s.doubt = calib::SensorDoubt::None;
        }
      }
    }
    return {};
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput,
                fmt::format("attachment {}: {}", attachment.name, cause_of(e)));
  }
}

}  // namespace abbe::daemon
