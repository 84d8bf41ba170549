#include "abbe/pipeline/sensor_state_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;
using std::chrono::nanoseconds;

constexpr int kSensorStateSchema = 1;
constexpr std::size_t kMostStateBytes = std::size_t{1} << 16;

json state_json(const json& state, const json& host_ns, const json& utc_ns) {
  return {{"host_ns", host_ns}, {"utc_ns", utc_ns}, {"sensors", state}};
}

/// Difference to add to a host time of the earlier run to get a host time of this run.
nanoseconds shift(const SensorStateClock& then, const SensorStateClock& now) {
  const auto passed = std::max(nanoseconds{0}, now.utc - then.utc);
  const auto host_passed = std::chrono::duration_cast<nanoseconds>(
      std::chrono::duration<double, std::nano>(static_cast<double>(passed.count()) * now.speed));
  return (now.host - host_passed) - then.host;
}

}  // namespace

std::filesystem::path sensor_state_file(const std::filesystem::path& data_dir) {
  return data_dir / kSensorStateName;
}

std::string sensor_state_text(const SensorChecks& checks, const SensorStateClock& now) {
  const json content = state_json(json::parse(checks.to_attachment().content),
                                  now.host.time_since_epoch().count(), now.utc.count());
  return indented_json_text(json{{"schema", kSensorStateSchema},
                                 {"sha256", sha256_hex(json_text(content))},
                                 {"state", content}}) +
         "\n";
}

Result<RecordingAttachment> left_sensor_state(std::string_view text,
                                              const SensorCheckOptions& options,
                                              const SensorStateClock& now) {
  const auto parsed =
      parse_json(text, kSensorStateName, {.bytes = kMostStateBytes, .depth = 8, .values = 2000});
  ABBE_TRY(parsed);
  try {
    if (parsed->at("schema").get<int>() != kSensorStateSchema)
      return fail(ErrorCode::BadInput, fmt::format("{}: another schema", kSensorStateName));
    const json& content = parsed->at("state");
    if (parsed->at("sha256").get<std::string>() != sha256_hex(json_text(content)))
      return fail(ErrorCode::BadInput, fmt::format("{}: its checksum is wrong", kSensorStateName));
    const SensorStateClock then{
        .host = protocol::HostTime{nanoseconds{content.at("host_ns").get<std::int64_t>()}},
        .utc = nanoseconds{content.at("utc_ns").get<std::int64_t>()}};

    SensorChecks checks{options};
    const auto read = checks.go_on(
        {std::string{kSensorStateName}, "application/json", json_text(content.at("sensors"))});
    ABBE_TRY(read);
    checks.shift(shift(then, now));
    return checks.to_attachment();
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", kSensorStateName, cause_of(e)));
  }
}

}  // namespace abbe::daemon
