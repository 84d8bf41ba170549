#include "abbe/dds/json_lines.hpp"

#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/dds/received_model.hpp"
#include "abbe/messages/cdr.hpp"
#include "abbe/result/try.hpp"

namespace abbe::dds {
namespace {

using Json = nlohmann::ordered_json;
using daemon::Topic;

#define FIELD(name) \
  { #name, m.name() }

Json fields(const v1::Snapshot& m) {
  return {FIELD(machine),         FIELD(sequence_number),
          FIELD(host_time_ns),    FIELD(utc_offset_ns),
          FIELD(u_time_ns),       FIELD(flags),
          FIELD(missing_mask),    FIELD(axes_compensated),
          FIELD(position),        FIELD(velocity),
          FIELD(u_position),      FIELD(has_tracker_point),
          FIELD(p_tracker_m),     FIELD(tracker_device_time_ns),
          FIELD(has_trigger),     FIELD(touch),
          FIELD(has_environment), FIELD(air_temperature_K),
          FIELD(air_pressure_Pa), FIELD(relative_humidity)};
}

Json fields(const v1::Compensation& m) {
  return {FIELD(machine),
          FIELD(sequence_number),
          FIELD(host_time_ns),
          {"kind", m.kind() == v1::QUANTITY_ERROR ? "error" : "command_correction"},
          {"state", name_of(m.state())},
          FIELD(inside),
          FIELD(tool_ok),
          FIELD(position_m),
          FIELD(tool_offset_m),
          FIELD(vector_m),
          FIELD(cov_m2),
          FIELD(model_id),
          FIELD(age_ns),
          FIELD(validity_ns)};
}

Json fields(const v1::Parameter& m) {
  return {FIELD(name), FIELD(position_m), FIELD(value), FIELD(u)};
}
Json fields(const v1::AxisRange& m) {
  return {FIELD(axis), FIELD(min_m), FIELD(max_m)};
}
Json fields(const v1::HullVertex& m) {
  return {FIELD(position_m)};
}

Json fields(const v1::GridNode& m) {
  return {FIELD(position_m), FIELD(error_m), FIELD(cov_m2), FIELD(inside)};
}

template <class T>
Json list(const std::vector<T>& elements) {
  Json array = Json::array();
  for (const T& e : elements) array.push_back(fields(e));
  return array;
}

Json fields(const v1::ErrorModel& m) {
  return {FIELD(machine),
          FIELD(sequence_number),
          FIELD(model_id),
          FIELD(method),
          FIELD(estimator),
          FIELD(gauge),
          FIELD(chain),
          FIELD(basis),
          FIELD(squareness),
          FIELD(tool_offset_m),
          {"parameters", list(m.parameters())},
          {"validity", list(m.validity())},
          {"validity_hull", list(m.validity_hull())},
          FIELD(recording_sha256),
          FIELD(created_utc_ns)};
}

Json fields(const v1::ErrorGrid& m) {
  return {FIELD(machine),  FIELD(slice),         FIELD(slices),     FIELD(sequence_number),
          FIELD(model_id), FIELD(tool_offset_m), FIELD(every_node), {"nodes", list(m.nodes())}};
}

Json fields(const v1::ModelState& m) {
  return {
      FIELD(machine), FIELD(sequence_number), FIELD(host_time_ns), {"state", name_of(m.state())},
      FIELD(reason),  FIELD(model_id),        FIELD(age_ns),       FIELD(validity_ns)};
}

Json fields(const v1::Identity& m) {
  return {FIELD(machine),
          FIELD(sequence_number),
          FIELD(host_time_ns),
          FIELD(machine_id),
          FIELD(twin),
          FIELD(twin_seen),
          FIELD(model_id),
          FIELD(model_simulated),
          FIELD(devices_simulated)};
}

Json fields(const v1::Health& m) {
  return {FIELD(machine), FIELD(stream),           FIELD(sequence_number), FIELD(host_time_ns),
          FIELD(state),   FIELD(rate_hz),          FIELD(samples),         FIELD(dropped),
          FIELD(gaps),    FIELD(clock_residual_s), FIELD(latency_p50_s),   FIELD(latency_p99_s),
          FIELD(fault)};
}

Json fields(const v1::CalibrationEvent& m) {
  return {FIELD(machine), FIELD(host_time_ns), FIELD(method),  FIELD(state),
          FIELD(reason),  FIELD(progress),     FIELD(model_id)};
}

#undef FIELD

template <class T>
daemon::Result<std::string> line(std::span<const std::byte> payload) {
  const auto value = daemon::decode<T>(payload);
  ABBE_TRY(value);
  Json object{{"topic", daemon::topic_name<T>()}};
  object.update(fields(*value));
  // The text may come from any participant and need not be valid UTF-8.
  return daemon::json_text(object);
}

}  // namespace

daemon::Result<std::string> json_line(Topic topic, std::span<const std::byte> payload) {
  switch (topic) {
    case Topic::Snapshot:
      return line<v1::Snapshot>(payload);
    case Topic::Compensation:
      return line<v1::Compensation>(payload);
    case Topic::ErrorModel:
      return line<v1::ErrorModel>(payload);
    case Topic::ErrorGrid:
      return line<v1::ErrorGrid>(payload);
    case Topic::ModelState:
      return line<v1::ModelState>(payload);
    case Topic::Health:
      return line<v1::Health>(payload);
    case Topic::CalibrationEvent:
      return line<v1::CalibrationEvent>(payload);
    case Topic::Identity:
      return line<v1::Identity>(payload);
  }

  return daemon::fail(daemon::ErrorCode::BadInput, "unknown topic");
}

}  // namespace abbe::dds
