#include "status_reply.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/config/unmeasured_air.hpp"
#include "model_status_name.hpp"
#include "motion_requests.hpp"
#include "tracker_requests.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

/// The buckets that are not empty: [exclusive upper bound in s, count]. A client that reads them
/// twice gets the histogram of the time in between as the difference.
json latency_json(const drivers::LatencyHistogram::Counts& counts) {
  json buckets = json::array();
  for (std::size_t i = 0; i < counts.of_bucket.size(); ++i) {
    if (counts.of_bucket[i] > 0)
      buckets.push_back(
          {in_seconds(drivers::LatencyHistogram::upper_bound(i)), counts.of_bucket[i]});
  }
  return buckets;
}

json device_json(const StreamHealth& h) {
  const auto& d = h.status;
  json out{{"name", d.name},
           {"state", d.state},
           {"connected", d.connected},
           {"rate_hz", h.rate_hz},
           {"samples", d.samples},
           {"dropped", d.dropped + d.raw_dropped},
           {"gaps", d.gaps},
           {"faults", d.faults},
           {"condition", d.condition},
           {"last_fault", d.last_fault},
           {"clock",
            {{"settled", d.clock.settled},
             {"skew_ppm", d.clock.skew * 1e6},
             {"residual_s", in_seconds(d.clock.residual)},
             {"u_time_s", in_seconds(d.clock.u_time)}}},
           {"latency_p50_s", h.latency_p50_s},
           {"latency_p99_s", h.latency_p99_s},
           {"latency_counts", latency_json(h.latency)}};
  if (h.behind_s) out["behind_s"] = *h.behind_s;
  return out;
}

json features_json(const std::vector<FeatureToTouch>& features) {
  json out = json::array();
  for (const FeatureToTouch& f : features) {
    json& feature =
        out.emplace_back(json{{"on", f.on}, {"touched", f.touched}, {"points", f.points}});
    if (f.at_m) feature["at_m"] = *f.at_m;
    if (f.normal) feature["normal"] = *f.normal;
  }
  return out;
}

json next_json(const RequestedTouch& next) {
  json out{{"place", next.place + 1},
           {"on", next.on},
           {"touched", next.touched},
           {"points", next.points}};
  if (next.measurement.empty())
    out["position"] = next.position;
  else
    out["measurement"] = next.measurement;
  if (next.features) out["features"] = features_json(*next.features);
  return out;
}

/// The value; null for NaN, which JSON does not have.
json number_or_null(double value) {
  return std::isnan(value) ? json{} : json(value);
}

/// The values, rounded to 0.1 nm or 0.1 nrad, so that the reply stays short.
json rounded(const std::vector<double>& values) {
  constexpr double kPerUnit = 1e10;
  json out = json::array();
  for (const double value : values)
    out.push_back(number_or_null(std::round(value * kPerUnit) / kPerUnit));
  return out;
}

json live_json(const LiveTables& live) {
  json tables = json::array();
  for (const LiveTable& table : live.tables) {
    json& out = tables.emplace_back(json{{"table", table.name},
                                         {"unit", table.is_angle ? "rad" : "m"},
                                         {"determined", table.determined()},
                                         {"value", rounded(table.value)},
                                         {"u", rounded(table.u)}});
    if (!table.at_m.empty()) out["at_m"] = rounded(table.at_m);
  }
  return {{"samples", live.samples},
          {"variance_factor", live.variance_factor},
          {"tables", std::move(tables)}};
}

json start_json(const StartState& start) {
  json conditions = json::array();
  for (const StartCondition& c : start.conditions)
    conditions.push_back({{"name", c.name}, {"met", c.met}, {"text", c.text}});
  return {{"ready", start.ready}, {"missed", start.missed}, {"conditions", std::move(conditions)}};
}

/// `speed`: host time per real time of simulated devices; 1 for real devices.
json session_json(const SessionStatus& s, const std::optional<calib::HeldOutFigures>& held_out,
                  double speed) {
  json out{{"id", s.id},
           {"state", name(s.state)},
           {"method", s.method},
           {"reason", s.reason},
           {"progress", s.progress},
           {"points", s.points},
           {"model_id", s.model_id},
           {"notes", s.notes},
           {"noted", s.noted}};
  if (s.state == SessionState::Refused) out["code"] = code_name(s.refused_as);
  if (s.next) out["next"] = next_json(*s.next);
  if (s.remaining) out["remaining_s"] = in_seconds(*s.remaining) / speed;
  if (s.start) out["start"] = start_json(*s.start);
  if (s.live) out["live"] = live_json(*s.live);

  if (!s.again.empty()) out["again"] = s.again;
  if (s.verdict)
    out["verdict"] = {{"figures", s.verdict->figures},
                      {"reasons", s.verdict->reasons},
                      {"notes", s.verdict->notes}};
  if (held_out) {
    out["held_out_rms_um"] = {{"candidate", held_out->candidate_rms_m * 1e6},
                              {"no_compensation", held_out->no_compensation_rms_m * 1e6}};
  }

  return out;
}

/// A copy of the active model's state.
struct SeenModel {
  explicit SeenModel(const ActiveModelState& active)
      : status(active.status),
        reason(active.reason),
        refused(active.refused),
        known(active.model != nullptr) {
    if (!known) return;
    id = active.model->id;
    method = active.model->method;
    recording_sha256 = active.model->recording_sha256;
    hash = active.model->hash;
    created = active.model->created;
    largest_U_m = active.model->largest_U_m;
    simulated = active.model->simulated;
  }
  v1::ModelStatus status;
  std::string reason, refused;
  bool known;
  std::string id, method, recording_sha256, hash;
  protocol::UtcTime created{};
  std::optional<double> largest_U_m;
  bool simulated = false;
};

json model_json(const SeenModel& model) {
  json out{{"state", status_name(model.status)}, {"reason", model.reason}};
  if (model.known) {
    out["id"] = model.id;
    out["method"] = model.method;
    out["recording_sha256"] = model.recording_sha256;
    out["hash"] = model.hash;
    out["created"] = to_text(model.created);
    out["simulated"] = model.simulated;
    if (!model.refused.empty()) out["refused"] = model.refused;
    if (model.largest_U_m) out["largest_U_um"] = *model.largest_U_m * kUmPerM;
  }
  return out;
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

struct SeenReference {
  bool running = false;
  std::vector<ReferenceService::AxisStatus> axes;
};

json reference_json(const SeenReference& reference, const MachineConfig& machine) {
  json axes = json::array();
  for (const auto& axis : reference.axes) {
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

  return {{"running", reference.running}, {"axes", std::move(axes)}};
}

/// The positions. A position that is not current is null, so that a client cannot use it as the
/// current one.
json positions_json(const protocol::Snapshot& live, bool old) {
  json positions = json::array();
  for (std::size_t axis = 0; axis < live.axis_count; ++axis) {
    const bool missing = old || (live.missing_mask >> axis & 1u) != 0 ||
                         has(live.head.flags, protocol::SampleFlag::BusOff);
    positions.push_back(missing ? json{} : number_or_null(live.position[axis]));
  }
  return positions;
}

/// Names and kinds of the axes of "position_m", in the same order: the axes that have an encoder or
/// a counter, or if there are none, the first axes of the machine, which a measuring machine
/// reports.
json axes_json(const Config& config, std::size_t count, const std::vector<std::string>& missing) {
  const auto& axes_of_machine = config.machine.axes;
  auto names = config.connected_axes();
  if (names.empty())
    for (const AxisConfig& axis : axes_of_machine) names.push_back(axis.name);
  names.resize(std::min(names.size(), count));

  json axes = json::array();
  for (const std::string& name : names) {
    const auto axis = std::ranges::find(axes_of_machine, name, &AxisConfig::name);
    const bool rotary = axis != axes_of_machine.end() && axis->kind == AxisKind::Rotary;
    json& out = axes.emplace_back(json{{"axis", name}, {"kind", rotary ? "rotary" : "linear"}});
    if (const auto& reason = missing.at(axes.size() - 1); !reason.empty()) out["missing"] = reason;
  }

  return axes;
}

struct SeenLink {
  explicit SeenLink(const Publisher& publisher)
      : state(publisher.link().state()),
        connected(publisher.link().answers()),
        counters(publisher.link().counters()),
        security(publisher.security_warning().empty() ? "on" : publisher.security_warning()),
        process(publisher.link().process()) {}
  std::string_view state;
  bool connected;
  DdsLinkCounters counters;
  std::string security;
  const DdsProcess* process;  ///< may be read by any thread
};

json dds_json(const SeenLink& link) {
  json out{{"state", link.state},
           {"connected", link.connected},
           {"sent", link.counters.sent},
           {"dropped_live", link.counters.dropped_live},
           {"connections", link.counters.connections},
           {"refused_connections", link.counters.foreign_connections},
           {"security", link.security}};

  if (link.process != nullptr) {
    out["process"] = link.process->pid();
    out["restarts"] = link.process->restarts();
    if (const auto end = link.process->last_end()) out["last_end"] = end->text();
  }

  return out;
}

json identity_json(const IdentityWatch::Known& identity, const std::string& twin) {
  json out{{"machine_id", identity.machine_id}, {"confirmed", identity.doubt.empty()}};
  if (const auto& why = identity.doubt.empty() ? identity.fault : identity.doubt; !why.empty())
    out["reason"] = why;
  if (!twin.empty()) out["twin"] = twin;
  return out;
}

/// The data of the answer to `status`, copied on the hub's thread.
struct SeenStatus {
  std::vector<StreamHealth> streams;
  SeenModel model;
  SessionStatus session;
  std::string recording_of_run;  // of `session`
  std::optional<calib::HeldOutFigures> held_out;
  std::deque<SessionStatus> ended;
  protocol::Snapshot live;
  std::vector<std::string> missing_scales;
  bool positions_are_old = true;
  std::optional<SeenReference> reference;
  std::optional<std::vector<std::string>> without_zero;
  std::optional<std::string> release_awaited, recording;
  drivers::IppStop machine_stop;
  std::optional<SeenTracker> tracker;
  std::optional<SeenLink> dds;
  std::optional<IdentityWatch::Known> identity;
  std::string twin;
};

bool positions_are_old(const Hub& hub) {
  const auto axes_at = hub.live().axes_at();
  const auto& time = hub.parts().time;
  return !axes_at || time.now() - *axes_at > time.host(kAxesTimeout);
}

SeenStatus look_at_status(const Hub& hub) {
  const HubParts& parts = hub.parts();
  SeenStatus seen{.streams = hub.health(),
                  .model = SeenModel{hub.model_state()},
                  .session = parts.calibration.status(),
                  .recording_of_run = parts.calibration.recording_of_run(),
                  .held_out = parts.calibration.session().held_out(),
                  .ended = parts.calibration.session().ended(),
                  .live = hub.live().view(),
                  .missing_scales = hub.live().missing_scales(),
                  .positions_are_old = positions_are_old(hub),
                  .reference = {},
                  .without_zero = {},
                  .release_awaited = parts.devices.release_awaited(),
                  .recording = {},
                  .machine_stop = parts.devices.machine_stop(),
                  .tracker = look_at_tracker(parts),
                  .dds = {},
                  .identity = {},
                  .twin = {}};

  if (const auto* reference = parts.reference; reference != nullptr) {
    if (reference->configured())
      seen.reference = SeenReference{.running = reference->running(), .axes = reference->status()};
    seen.without_zero = reference->without_zero();
  }

  if (parts.recorder != nullptr) seen.recording = parts.recorder->status().file.string();
  if (parts.publisher != nullptr) seen.dds.emplace(*parts.publisher);
  if (parts.publisher != nullptr) seen.twin = parts.publisher->link().twin();
  if (parts.identity != nullptr) seen.identity = parts.identity->known();
  return seen;
}

/// The reason why each axis has no position; empty: it has one.
std::vector<std::string> missing_reasons(const SeenStatus& seen) {
  std::vector<std::string> reasons(seen.live.axis_count);
  for (std::size_t axis = 0; axis < reasons.size(); ++axis) {
    if (seen.positions_are_old)
      reasons[axis] = "no reading of the axes arrives: see the device that reads them";
    else if (has(seen.live.head.flags, protocol::SampleFlag::BusOff))
      reasons[axis] = "the bus of the encoders is off";
    else if (axis < seen.missing_scales.size() && !seen.missing_scales[axis].empty())
      reasons[axis] = seen.missing_scales[axis];
    else if ((seen.live.missing_mask >> axis & 1u) != 0)
      reasons[axis] = "its encoder gives no reading, or the axis is not referenced";
  }
  return reasons;
}

json status_json(const SeenStatus& seen, const Config& config) {
  json devices = json::array();
  for (const auto& h : seen.streams) devices.push_back(device_json(h));
  json out{{"ok", true},
           {"process", ::getpid()},
           {"machine", config.machine.name},
           {"simulated", config.daemon.simulated},
           {"model", model_json(seen.model)},
           {"session", session_json(seen.session, seen.held_out, config.daemon.speed)},
           {"streams", std::move(devices)}};
  if (!seen.recording_of_run.empty()) out["session"]["recording"] = seen.recording_of_run;
  json& ended = out["ended_sessions"] = json::array();
  for (const auto& session : seen.ended)
    ended.push_back(session_json(session, {}, config.daemon.speed));
  out["position_m"] = positions_json(seen.live, seen.positions_are_old);
  out["axes"] = axes_json(config, seen.live.axis_count, missing_reasons(seen));
  if (seen.live.has_environment) out["environment"] = environment_json(seen.live, config);
  const auto tracker = tracker_source(config);
  if (const auto air = tracker ? unmeasured_air_text(config, tracker->u_scale) : std::nullopt)
    out["unmeasured_air"] = *air;
  if (seen.reference) out["reference"] = reference_json(*seen.reference, config.machine);
  if (seen.without_zero) out["axes_without_zero"] = *seen.without_zero;
  if (seen.release_awaited)
    out["release_awaited"] = {{"reason", *seen.release_awaited},
                              {"command", "abbe machine release"}};
  if (const auto machine = motion_source(config)) out["measuring_machine"] = machine->device;
  json stopped = json::object();
  add_stop(stopped, seen.machine_stop);
  if (stopped.contains("stop")) out["machine_stop"] = stopped["stop"];
  if (seen.tracker) out["tracker"] = tracker_json(*seen.tracker);
  if (seen.recording) out["recording"] = *seen.recording;
  if (seen.dds) out["dds"] = dds_json(*seen.dds);
  if (seen.identity) out["identity"] = identity_json(*seen.identity, seen.twin);

  return out;
}
}  // namespace

Reply status_reply(const Hub& hub) {
  return [seen = look_at_status(hub), &config = hub.parts().config,
          &clock = hub.parts().calibration.clock()] {
    json out = status_json(seen, config);
    if (const auto changes = in_words(clock.since_start(), "abbed started"); !changes.empty())
      out["clock"] = changes;
    return out;
  };
}

Reply live_reply(const Hub& hub) {
  return [live = hub.live().view(), old = positions_are_old(hub)] {
    return json{{"ok", true}, {"position_m", positions_json(live, old)}};
  };
}

}  // namespace abbe::daemon
