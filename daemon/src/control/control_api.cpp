#include "abbe/daemon/control_api.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "abbe/daemon/control_protocol.hpp"
#include "control/refusal.hpp"
#include "linear_axes.hpp"
#include "units.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

std::string_view status_name(v1::ModelStatus status) {
  switch (status) {
    case v1::ModelStatus::MODEL_NONE:
      return "NONE";
    case v1::ModelStatus::MODEL_ACTIVE:
      return "ACTIVE";
    case v1::ModelStatus::MODEL_STALE:
      return "STALE";
    case v1::ModelStatus::MODEL_DRIFT:
      return "DRIFT";
    case v1::ModelStatus::MODEL_INVALID:
      return "INVALID";
  }
  return "INVALID";
}

json device_json(const StreamHealth& h) {
  const auto& d = h.status;
  return {{"name", d.name},
          {"state", d.state},
          {"connected", d.connected},
          {"rate_hz", h.rate_hz},
          {"samples", d.samples},
          {"dropped", d.dropped + d.raw_dropped},
          {"gaps", d.gaps},
          {"faults", d.faults},
          {"last_fault", d.last_fault},
          {"clock",
           {{"settled", d.clock.settled},
            {"skew_ppm", d.clock.skew * 1e6},
            {"residual_s", in_seconds(d.clock.residual)},
            {"u_time_s", in_seconds(d.clock.u_time)}}},
          {"latency_p50_s", h.latency_p50_s},
          {"latency_p99_s", h.latency_p99_s}};
}

json next_json(const calib::evemu::NextTouch& next) {
  return {{"position", next.position},
          {"place", next.place + 1},
          {"on", calib::evemu::name(next.on)},
          {"touched", next.touched},
          {"points", next.points}};
}

json session_json(const SessionStatus& s, const std::optional<calib::HeldOutFigures>& held_out) {
  json out{{"state", name(s.state)}, {"method", s.method},     {"reason", s.reason}, {"progress", s.progress},
           {"points", s.points},     {"model_id", s.model_id}, {"notes", s.notes},   {"noted", s.noted}};
  if (s.state == SessionState::Refused) out["code"] = word_of(s.refused_as);
  if (s.next) out["next"] = next_json(*s.next);
  if (held_out) {
    out["held_out_rms_um"] = {{"candidate", held_out->candidate_rms_m * 1e6},
                              {"no_compensation", held_out->no_compensation_rms_m * 1e6}};
  }
  return out;
}

json model_json(const ModelStanding& standing) {
  json out{{"state", status_name(standing.status)}, {"reason", standing.reason}};
  if (standing.model != nullptr) {
    out["id"] = standing.model->id;
    out["method"] = standing.model->method;
    out["recording_sha256"] = standing.model->recording_sha256;
  }
  return out;
}

/// NaN has no place in JSON.
json number_or_null(double value) {
  return std::isnan(value) ? json{} : json(value);
}

json environment_json(const protocol::Snapshot& live, const Config& config) {
  const auto& e = live.environment;
  json out{{"air_temperature_C", number_or_null(e.air_temperature_K - kZeroCelsius_K)},
           {"air_pressure_hPa", number_or_null(e.air_pressure_Pa * 1e-2)},
           {"relative_humidity_percent", number_or_null(e.relative_humidity * 1e2)}};
  json temperatures = json::object();
  for (std::size_t i = 0; i < config.temperatures.size(); ++i)
    temperatures[config.temperatures[i]] = number_or_null(e.temperature_K[i] - kZeroCelsius_K);
  out["temperatures_C"] = std::move(temperatures);
  if (const auto index = index_of_air(e, config.air))
    out["refractive_index"] = {{"n", index->n}, {"u_n", index->u_n}};
  return out;
}

std::string_view name(AxisReference::State state) {
  switch (state) {
    case AxisReference::State::Searching:
      return "searching";
    case AxisReference::State::Found:
      return "found";
    case AxisReference::State::Failed:
      return "failed";
  }
  return "failed";
}

json reference_json(const ReferenceService& reference, const MachineConfig& machine) {
  json axes = json::array();
  for (const auto& axis : reference.status()) {
    const AxisConfig* known = machine.find_axis(axis.name);
    const bool rotary = known != nullptr && known->kind == AxisKind::Rotary;
    json& out = axes.emplace_back(json{{"axis", axis.name},
                                       {"kind", rotary ? "rotary" : "linear"},
                                       {"known", axis.known},
                                       {"state", name(axis.found.state)},
                                       {"marks", axis.found.marks},
                                       {"reason", axis.found.reason}});
    if (axis.found.state != AxisReference::State::Found) continue;
    out["reading_at_zero"] = axis.reading_at_zero;
    out["u"] = axis.found.u_offset;
  }
  return {{"running", reference.running()}, {"axes", std::move(axes)}};
}

json status(const Hub& hub) {
  json devices = json::array();
  for (const auto& h : hub.health()) devices.push_back(device_json(h));
  json out{{"ok", true},
           {"process", ::getpid()},
           {"machine", hub.parts().config.machine.name},
           {"model", model_json(hub.standing())},
           {"session", session_json(hub.parts().calibration.status(), hub.parts().calibration.held_out())},
           {"streams", std::move(devices)}};
  const auto& live = hub.live().view();
  out["position_m"] = std::vector<double>(live.position.begin(), live.position.begin() + live.axis_count);
  if (live.has_environment) out["environment"] = environment_json(live, hub.parts().config);
  if (const auto* reference = hub.parts().reference; reference != nullptr && reference->configured())
    out["reference"] = reference_json(*reference, hub.parts().config.machine);
  if (hub.parts().reference != nullptr) out["axes_without_zero"] = hub.parts().reference->without_zero();
  if (hub.parts().recorder != nullptr) out["recording"] = hub.parts().recorder->status().file.string();
  if (hub.parts().publisher != nullptr) {
    const auto& link = hub.parts().publisher->link();
    out["dds"] = {{"connected", link.connected()},
                  {"sent", link.counters().sent},
                  {"dropped_live", link.counters().dropped_live},
                  {"connections", link.counters().connections}};
  }
  return out;
}

/// Who asks, as the kernel says; a name the client gives itself is a remark (a person behind a service).
std::string who(const json& request) {
  const auto user = request.value("user", std::string{"somebody"});
  const auto said = request.value("who", std::string{});
  return said.empty() || said == user ? user : fmt::format("{} (as {})", user, said);
}

/// Readings of X, Y or Z without a datum are used by nobody: a run would wait for them in vain.
Result<void> check_zeros(const HubParts& parts, const CalibrationTask& task) {
  const bool by_cmm = std::holds_alternative<EvemuRequest>(task) && parts.config.cmm.has_value();
  if (parts.reference == nullptr || by_cmm) return {};
  auto unknown = parts.reference->unknown();
  const auto linear =
      std::span{parts.config.machine.axes}.first(std::min(kLinearAxes, parts.config.machine.axes.size()));
  std::erase_if(unknown, [&linear](const std::string& name) {
    return std::ranges::find(linear, name, &AxisConfig::name) == linear.end();
  });
  if (unknown.empty()) return {};
  return fail(ErrorCode::Refused,
              fmt::format("calibrate: nobody knows the zero of {}: `abbe reference` finds the marks, `abbe "
                          "reference --here` says that the axes read their offset",
                          fmt::join(unknown, ", ")));
}

json calibrate(const Hub& hub, const json& request) {
  const HubParts& parts = hub.parts();
  auto task = task_from_json(request, touch_plan(parts.config.evemu));
  if (!task) return refusal(task.error());
  if (const auto known = check_zeros(parts, *task); !known) return refusal(known.error());
  auto started = parts.calibration.start(std::move(*task), who(request), parts.time.now());
  return started ? json{{"ok", true}} : refusal(started.error());
}

json cancel(const Hub& hub, const json& request) {
  auto done = hub.parts().calibration.cancel(who(request), hub.parts().time.now());
  return done ? json{{"ok", true}} : refusal(done.error());
}

StandHere stand_here(const HubParts& parts, const json& request) {
  const SessionState state = parts.calibration.status().state;
  StandHere here{.axes = request.value("axes", std::vector<std::string>{}), .now = parts.time.now()};
  here.u = request.value("u", StandHere::kByEye);
  here.patience = parts.time.host(here.patience);
  here.acquiring = state == SessionState::Warming || state == SessionState::Acquiring;
  return here;
}

json reference(const Hub& hub, const json& request) {
  if (hub.parts().reference == nullptr) return refusal({ErrorCode::Refused, "reference: not in this daemon"});
  ReferenceService& service = *hub.parts().reference;
  auto done = request.value("here", false)     ? service.stand_at_offset(stand_here(hub.parts(), request))
              : request.value("cancel", false) ? service.cancel()
                                               : service.start();
  return done ? json{{"ok", true}} : refusal(done.error());
}

json point_json(const StandstillPoint& p) {
  const auto list = [](const calib::Vector3& v) { return json{v.x(), v.y(), v.z()}; };
  return {{"reading_m", list(p.mean.reading_m)},
          {"tracker_m", list(p.mean.measured_m)},
          {"tracker_points", p.tracker_points},
          {"scatter_m", p.scatter_m}};
}

/// {"step": "begin"} gives a number; {"step": "look" | "end", "number": .., "from": k} the points from the
/// k-th on, "end" after the standstill that goes on was closed.
json verification(const Hub& hub, const json& request) {
  if (hub.parts().verification == nullptr) return refusal({ErrorCode::Refused, "verify: not in this daemon"});
  VerificationService& service = *hub.parts().verification;
  const auto step = request.at("step").get<std::string>();
  if (step == "begin") {
    const auto number = service.begin();
    return number ? json{{"ok", true}, {"number", *number}} : refusal(number.error());
  }
  const auto number = request.at("number").get<std::uint64_t>();
  if (step == "end") {
    if (const auto ended = service.end(number); !ended) return refusal(ended.error());
  } else if (step != "look") {
    return refusal({ErrorCode::Usage, fmt::format("verification: unknown step {}", step)});
  }
  const auto found = service.points(number);
  if (!found) return refusal(found.error());
  const auto& points = (*found)->points();
  json list = json::array();
  for (std::size_t i = request.value("from", std::size_t{0}); i < points.size(); ++i)
    list.push_back(point_json(points[i]));
  return {{"ok", true}, {"standing", (*found)->standing()}, {"points", std::move(list)}};
}

drivers::ProbePoint place_from(const json& place, bool touch) {
  return {.position_m = place.get<std::array<double, 3>>(), .touch = touch};
}

json touch(const Hub& hub, const json& request) {
  if (hub.parts().touching == nullptr) return refusal({ErrorCode::Refused, "touch: not in this daemon"});
  TouchService& service = *hub.parts().touching;
  if (request.value("cancel", false)) {
    auto done = service.cancel();
    return done ? json{{"ok", true}} : refusal(done.error());
  }
  if (request.value("where", false)) {
    const auto at = service.where();
    return at ? json{{"ok", true}, {"at_m", *at}} : refusal(at.error());
  }
  std::vector<TouchRequest> wanted;
  for (const json& point : request.at("points")) {
    TouchRequest& one = wanted.emplace_back();
    for (const json& place : point.at("way")) one.way.push_back(place_from(place, false));
    one.point = place_from(point.at("at_m"), true);
    one.point.normal = point.at("normal").get<std::array<double, 3>>();
  }
  std::vector<drivers::ProbePoint> leave;
  for (const json& place : request.value("leave", json::array())) leave.push_back(place_from(place, false));
  auto started = service.start(std::move(wanted), std::move(leave));
  return started ? json{{"ok", true}} : refusal(started.error());
}

json touches(const Hub& hub, const json&) {
  if (hub.parts().touching == nullptr) return refusal({ErrorCode::Refused, "touch: not in this daemon"});
  const TouchService::Status& status = hub.parts().touching->look();
  json made = json::array();
  for (const auto& t : status.touches)
    made.push_back({{"at_m", {t.position[0], t.position[1], t.position[2]}}, {"u_m", t.u_position[0]}});
  return {{"ok", true},
          {"running", status.running},
          {"asked", status.asked},
          {"reason", status.reason},
          {"touches", std::move(made)}};
}

}  // namespace

json answer_request(Hub& hub, const json& request, std::chrono::milliseconds time_out) {
  using Task = json (*)(const Hub&, const json&);
  static const std::map<std::string, Task> kTasks{
      {"status", [](const Hub& h, const json&) { return status(h); }},
      {"calibrate", calibrate},
      {"cancel", cancel},
      {"reference", reference},
      {"verification", verification},
      {"touch", touch},
      {"touches", touches},
  };
  const auto what = request.at("do").get<std::string>();
  const auto task = kTasks.find(what);
  if (task == kTasks.end()) {
    return refusal(
        {ErrorCode::Usage,
         fmt::format("unknown request \"{}\": known are status, calibrate, cancel, reference, verification, "
                     "touch, touches",
                     what)});
  }
  auto answer = hub.call([&hub, run = task->second, request] { return run(hub, request); }, time_out);
  return answer ? std::move(*answer)
                : refusal({ErrorCode::Io, fmt::format("the hub did not answer in {} ms", time_out.count())});
}

}  // namespace abbe::daemon
