#include "abbe/daemon/control_api.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/daemon/control_protocol.hpp"
#include "control/model_status_name.hpp"
#include "control/refusal.hpp"
#include "control/tracker_requests.hpp"
#include "linear_axes.hpp"
#include "units.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

// A request goes three steps: what it says is read on the thread that asks, however much it is; what the hub has
// to do or to look at for it is short; the answer is written on the thread that asks again.
using Reply = std::function<json()>;
using OnHub = std::function<Reply(const Hub&)>;

Reply reply(json answer) {
  return [answer = std::move(answer)] { return answer; };
}
Reply reply(const Error& error) {
  return [error] { return refusal(error); };
}
Reply reply_done(const Result<void>& done) {
  return done ? reply(json{{"ok", true}}) : reply(done.error());
}

// As the hub: without axis positions for this long (wall time) they are not known.
constexpr std::chrono::milliseconds kPositionIsOld{500};

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
          {"condition", d.condition},
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
  json out{{"id", s.id},
           {"state", name(s.state)},
           {"method", s.method},
           {"reason", s.reason},
           {"progress", s.progress},
           {"points", s.points},
           {"model_id", s.model_id},
           {"notes", s.notes},
           {"noted", s.noted}};
  if (s.state == SessionState::Refused) out["code"] = word_of(s.refused_as);
  if (s.next) out["next"] = next_json(*s.next);
  if (held_out) {
    out["held_out_rms_um"] = {{"candidate", held_out->candidate_rms_m * 1e6},
                              {"no_compensation", held_out->no_compensation_rms_m * 1e6}};
  }
  return out;
}

/// The model in force as the hub saw it.
struct SeenModel {
  explicit SeenModel(const ModelStanding& standing)
      : status(standing.status), reason(standing.reason), known(standing.model != nullptr) {
    if (!known) return;
    id = standing.model->id;
    method = standing.model->method;
    recording_sha256 = standing.model->recording_sha256;
  }
  v1::ModelStatus status;
  std::string reason;
  bool known;
  std::string id, method, recording_sha256;
};

json model_json(const SeenModel& model) {
  json out{{"state", status_name(model.status)}, {"reason", model.reason}};
  if (model.known) {
    out["id"] = model.id;
    out["method"] = model.method;
    out["recording_sha256"] = model.recording_sha256;
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

/// A position that is not current is null: the last one would pass for where the axis is.
json positions_json(const protocol::Snapshot& live, bool old) {
  json positions = json::array();
  for (std::size_t axis = 0; axis < live.axis_count; ++axis) {
    const bool missing =
        old || (live.missing_mask >> axis & 1u) != 0 || has(live.head.flags, protocol::SampleFlag::BusOff);
    positions.push_back(missing ? json{} : number_or_null(live.position[axis]));
  }
  return positions;
}

struct SeenLink {
  explicit SeenLink(const Publisher& publisher)
      : connected(publisher.link().connected()),
        counters(publisher.link().counters()),
        security(publisher.security_warning().empty() ? "on" : publisher.security_warning()),
        process(publisher.link().process()) {}
  bool connected;
  DdsLinkCounters counters;
  std::string security;
  const DdsProcess* process;  ///< for any thread
};

json dds_json(const SeenLink& link) {
  json out{{"connected", link.connected},
           {"sent", link.counters.sent},
           {"dropped_live", link.counters.dropped_live},
           {"connections", link.counters.connections},
           {"refused_connections", link.counters.strangers},
           {"security", link.security}};
  if (link.process != nullptr) {
    out["process"] = link.process->pid();
    out["restarts"] = link.process->restarts();
    if (const auto end = link.process->last_end()) out["last_end"] = end->text();
  }
  return out;
}

/// What `status` tells, copied on the hub's thread.
struct SeenStatus {
  std::vector<StreamHealth> streams;
  SeenModel model;
  SessionStatus session;
  std::optional<calib::HeldOutFigures> held_out;
  std::deque<SessionStatus> ended;
  protocol::Snapshot live;
  bool positions_are_old = true;
  std::optional<SeenReference> reference;
  std::optional<std::vector<std::string>> without_zero;
  std::optional<std::string> release_awaited, recording;
  std::optional<SeenTracker> tracker;
  std::optional<SeenLink> dds;
};

SeenStatus look_at_status(const Hub& hub) {
  const HubParts& parts = hub.parts();
  const auto axes_at = hub.live().axes_at();
  SeenStatus seen{.streams = hub.health(),
            .model = SeenModel{hub.standing()},
            .session = parts.calibration.status(),
            .held_out = parts.calibration.held_out(),
            .ended = parts.calibration.ended(),
            .live = hub.live().view(),
            .positions_are_old = !axes_at || parts.time.now() - *axes_at > parts.time.host(kPositionIsOld),
            .reference = {},
            .without_zero = {},
            .release_awaited = parts.devices.release_awaited(),
            .recording = {},
            .tracker = look_at_tracker(parts),
            .dds = {}};
  if (const auto* reference = parts.reference; reference != nullptr) {
    if (reference->configured())
      seen.reference = SeenReference{.running = reference->running(), .axes = reference->status()};
    seen.without_zero = reference->without_zero();
  }
  if (parts.recorder != nullptr) seen.recording = parts.recorder->status().file.string();
  if (parts.publisher != nullptr) seen.dds.emplace(*parts.publisher);
  return seen;
}

json status_json(const SeenStatus& seen, const Config& config) {
  json devices = json::array();
  for (const auto& h : seen.streams) devices.push_back(device_json(h));
  json out{{"ok", true},
           {"process", ::getpid()},
           {"machine", config.machine.name},
           {"model", model_json(seen.model)},
           {"session", session_json(seen.session, seen.held_out)},
           {"streams", std::move(devices)}};
  json& ended = out["ended_sessions"] = json::array();
  for (const auto& session : seen.ended) ended.push_back(session_json(session, {}));
  out["position_m"] = positions_json(seen.live, seen.positions_are_old);
  if (seen.live.has_environment) out["environment"] = environment_json(seen.live, config);
  if (seen.reference) out["reference"] = reference_json(*seen.reference, config.machine);
  if (seen.without_zero) out["axes_without_zero"] = *seen.without_zero;
  if (seen.release_awaited)
    out["release_awaited"] = {{"reason", *seen.release_awaited}, {"command", "abbe machine release"}};
  if (seen.tracker) out["tracker"] = tracker_json(*seen.tracker);
  if (seen.recording) out["recording"] = *seen.recording;
  if (seen.dds) out["dds"] = dds_json(*seen.dds);
  return out;
}

Result<OnHub> status(const HubParts&, const json&) {
  return [](const Hub& hub) -> Reply {
    return [seen = look_at_status(hub), &config = hub.parts().config] { return status_json(seen, config); };
  };
}

/// For terminals and the journal, and for ever in the store.
std::string remark_of(std::string who) {
  constexpr std::size_t kMost = 64;
  if (who.size() > kMost) {
    std::size_t end = kMost;  // between two characters of UTF-8
    while (end > 0 && (static_cast<unsigned char>(who[end]) & 0xc0) == 0x80) --end;
    who.replace(end, std::string::npos, "...");
  }
  std::ranges::replace_if(
      who, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return who;
}

/// Who asks, as the kernel says; a name the client gives itself is a remark (a person behind a service).
std::string who(const json& request) {
  const auto user = request.value("user", std::string{"somebody"});
  const auto said = remark_of(request.value("who", std::string{}));
  return said.empty() || said == user ? user : fmt::format("{} (as {})", user, said);
}

/// Readings of X, Y or Z without a datum are used by nobody: a run would wait for them in vain.
Result<void> check_zeros(const HubParts& parts, const PreparedSession& task) {
  const bool by_cmm =
      std::holds_alternative<EvemuAcquisition>(task.acquisition) && parts.config.cmm.has_value();
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

/// Points of before an order do not belong to those after it.
Result<void> check_tracker_is_free(const HubParts& parts, const PreparedSession& task) {
  const auto* order = parts.tracker != nullptr ? parts.tracker->running() : nullptr;
  if (order == nullptr || std::holds_alternative<EvemuAcquisition>(task.acquisition)) return {};
  return fail(ErrorCode::Refused,
              fmt::format("calibrate: the tracker carries out \"{}\" of {}: wait for its end (`abbe tracker "
                          "status`)",
                          drivers::name_of(order->asked.what), order->by));
}

Result<OnHub> calibrate(const HubParts& parts, const json& request) {
  auto task = task_from_json(request, touch_plan(parts.config.evemu));
  if (!task) return tl::unexpected(task.error());
  auto prepared = parts.calibration.prepare(std::move(*task));
  if (!prepared) return tl::unexpected(prepared.error());
  auto shared = std::make_shared<PreparedCalibration>(std::move(*prepared));
  return [shared, by = who(request)](const Hub& hub) {
    const HubParts& on = hub.parts();
    if (const auto known = check_zeros(on, shared->session); !known) return reply(known.error());
    if (const auto free = check_tracker_is_free(on, shared->session); !free) return reply(free.error());
    const auto started = on.calibration.start(std::move(*shared), by, on.time.now());
    return started ? reply(json{{"ok", true}, {"session", *started}}) : reply(started.error());
  };
}

Result<OnHub> cancel(const HubParts&, const json& request) {
  return [by = who(request)](const Hub& hub) {
    return reply_done(hub.parts().calibration.cancel(by, hub.parts().time.now()));
  };
}

StandHere stand_here(const HubParts& parts, const std::vector<std::string>& axes, double u) {
  StandHere here{.axes = axes, .u = u, .now = parts.time.now()};
  here.patience = parts.time.host(here.patience);
  here.acquiring = takes_readings(parts.calibration.status().state);
  return here;
}

OnHub with_reference(std::function<Result<void>(ReferenceService&, const HubParts&)> task) {
  return [task = std::move(task)](const Hub& hub) {
    ReferenceService* const service = hub.parts().reference;
    return service == nullptr ? reply(Error{ErrorCode::Refused, "reference: not in this daemon"})
                              : reply_done(task(*service, hub.parts()));
  };
}

Result<OnHub> reference_here(const HubParts&, const json& request) {
  return with_reference([axes = request.value("axes", std::vector<std::string>{}),
                         u = request.value("u", StandHere::kByEye)](ReferenceService& service,
                                                                    const HubParts& parts) {
    return service.stand_at_offset(stand_here(parts, axes, u));
  });
}

Result<OnHub> cancel_reference(const HubParts&, const json&) {
  return with_reference([](ReferenceService& service, const HubParts&) { return service.cancel(); });
}

Result<OnHub> reference(const HubParts&, const json&) {
  return with_reference([](ReferenceService& service, const HubParts&) { return service.start(); });
}

json point_json(const StandstillPoint& p) {
  const auto list = [](const calib::Vector3& v) { return json{v.x(), v.y(), v.z()}; };
  return {{"reading_m", list(p.mean.reading_m)},
          {"tracker_m", list(p.mean.measured_m)},
          {"tracker_points", p.tracker_points},
          {"scatter_m", p.scatter_m}};
}

/// Standstills from the one on that was asked for.
struct SeenPoints {
  std::size_t standing = 0;
  std::vector<StandstillPoint> points;
  std::string stopped;
};

json verification_json(const SeenPoints& seen) {
  json list = json::array();
  for (const StandstillPoint& p : seen.points) list.push_back(point_json(p));
  json out{{"ok", true}, {"standing", seen.standing}, {"points", std::move(list)}};
  if (!seen.stopped.empty()) out["stopped"] = seen.stopped;
  return out;
}

Reply begin_verification(VerificationService& service) {
  const auto number = service.begin();
  return number ? reply(json{{"ok", true}, {"number", *number}}) : reply(number.error());
}

Reply look_at_verification(VerificationService& service, std::uint64_t number, std::size_t from, bool end) {
  if (end)
    if (const auto ended = service.end(number); !ended) return reply(ended.error());
  const auto found = service.points(number);
  if (!found) return reply(found.error());
  const auto& all = (*found)->points();
  const auto first = all.begin() + static_cast<std::ptrdiff_t>(std::min(from, all.size()));
  return [seen = SeenPoints{.standing = (*found)->standing(),
                            .points = {first, all.end()},
                            .stopped = service.stopped()}] { return verification_json(seen); };
}

/// {"step": "begin"} gives a number; {"step": "look" | "end", "number": .., "from": k} the points from the
/// k-th on, "end" after the standstill that goes on was closed.
Result<OnHub> verification(const HubParts& parts, const json& request) {
  if (parts.verification == nullptr) return fail(ErrorCode::Refused, "verify: not in this daemon");
  const auto step = request.at("step").get<std::string>();
  if (step == "begin")
    return [](const Hub& hub) { return begin_verification(*hub.parts().verification); };
  if (step != "end" && step != "look")
    return fail(ErrorCode::Usage, fmt::format("verification: unknown step {}", step));
  return [number = request.at("number").get<std::uint64_t>(), from = request.value("from", std::size_t{0}),
          end = step == "end"](const Hub& hub) {
    return look_at_verification(*hub.parts().verification, number, from, end);
  };
}

drivers::ProbePoint place_from(const json& place, bool touch) {
  return {.position_m = place.get<std::array<double, 3>>(), .touch = touch};
}

OnHub with_touching(std::function<Reply(TouchService&)> task) {
  return [task = std::move(task)](const Hub& hub) {
    TouchService* const service = hub.parts().touching;
    return service == nullptr ? reply(Error{ErrorCode::Refused, "touch: not in this daemon"}) : task(*service);
  };
}

Result<OnHub> cancel_touching(const HubParts&, const json&) {
  return with_touching([](TouchService& service) { return reply_done(service.cancel()); });
}

Result<OnHub> where_it_stands(const HubParts&, const json&) {
  return with_touching([](TouchService& service) {
    const auto at = service.where();
    return at ? reply(json{{"ok", true}, {"at_m", *at}}) : reply(at.error());
  });
}

Result<OnHub> touch(const HubParts&, const json& request) {
  std::vector<TouchRequest> wanted;
  for (const json& point : request.at("points")) {
    TouchRequest& one = wanted.emplace_back();
    for (const json& place : point.at("way")) one.way.push_back(place_from(place, false));
    one.point = place_from(point.at("at_m"), true);
    one.point.normal = point.at("normal").get<std::array<double, 3>>();
  }
  std::vector<drivers::ProbePoint> leave;
  for (const json& place : request.value("leave", json::array())) leave.push_back(place_from(place, false));
  auto job = touch_job(std::move(wanted), std::move(leave));
  if (!job) return tl::unexpected(job.error());
  return with_touching([shared = std::make_shared<TouchJob>(std::move(*job))](TouchService& service) {
    return reply_done(service.start(std::move(*shared)));
  });
}

/// What became of a job; of each touch only what is answered.
struct SeenTouches {
  struct Made {
    std::array<double, 3> at_m{};
    double u_m = 0.0;
  };
  bool running = false;
  std::size_t asked = 0;
  std::string reason;
  std::vector<Made> touches;
};

json touches_json(const SeenTouches& seen) {
  json made = json::array();
  for (const auto& t : seen.touches) made.push_back({{"at_m", t.at_m}, {"u_m", t.u_m}});
  return {{"ok", true},
          {"running", seen.running},
          {"asked", seen.asked},
          {"reason", seen.reason},
          {"touches", std::move(made)}};
}

Result<OnHub> touches(const HubParts&, const json&) {
  return with_touching([](TouchService& service) -> Reply {
    const TouchService::Status& status = service.look();
    SeenTouches seen{.running = status.running, .asked = status.asked, .reason = status.reason, .touches = {}};
    seen.touches.reserve(status.touches.size());
    for (const auto& t : status.touches)
      seen.touches.push_back({{t.position[0], t.position[1], t.position[2]}, t.u_position[0]});
    return [seen = std::move(seen)] { return touches_json(seen); };
  });
}

/// For a person who has looked at the machine.
Result<OnHub> release_machine(const HubParts&, const json&) {
  return [](const Hub& hub) {
    SampleSource& devices = hub.parts().devices;
    const auto awaited = devices.release_awaited();
    const auto released = devices.release_machine();
    return released ? reply(json{{"ok", true}, {"released", awaited.value_or("")}}) : reply(released.error());
  };
}

/// Every motion.
Result<OnHub> stop_machine(const HubParts&, const json&) {
  return [](const Hub& hub) {
    auto* const touching = hub.parts().touching;
    if (touching == nullptr || !touching->status().running || !touching->cancel())
      hub.parts().devices.stop_machine();
    return reply(json{{"ok", true}});
  };
}

Result<OnHub> machine(const HubParts&, const json&) {
  return [](const Hub& hub) {
    SampleSource& devices = hub.parts().devices;
    const auto awaited = devices.release_awaited();
    json out{{"ok", true}, {"release_awaited", awaited.has_value()}, {"reason", awaited.value_or("")}};
    if (const auto tip = devices.tip_place()) {
      out["tip_m"] = tip->at_m;
      out["tip_age_s"] = in_seconds(tip->age);
    }
    return reply(std::move(out));
  };
}

OnHub give_tracker(drivers::TrackerOrder order, std::string by) {
  return [order = std::move(order), by = std::move(by)](const Hub& hub) {
    const auto number = order_tracker(hub.parts(), order, by);
    return number ? reply(json{{"ok", true}, {"order", *number}}) : reply(number.error());
  };
}

Result<OnHub> tracker_order(const HubParts&, const json& request) {
  auto order = tracker_order_from_json(request);
  if (!order) return tl::unexpected(order.error());
  return give_tracker(std::move(*order), who(request));
}

Result<OnHub> tracker_reflectors(const HubParts&, const json& request) {
  return give_tracker({.what = drivers::TrackerOrder::What::ListReflectors}, who(request));
}

/// One thing that may be asked. Without a role it does not compile.
struct Verb {
  using Task = Result<OnHub> (*)(const HubParts&, const json&);
  constexpr Verb(std::string_view does, std::string_view with, Role needs, Task runs)
      : name(does), member(with), role(needs), task(runs) {}

  std::string_view name;
  std::string_view member;  ///< only where the request says true for it; empty: in every other case
  Role role;
  Task task;
};

// Nothing is run that is not found here: what a request needs and what it does cannot differ.
constexpr std::array kVerbs{
    Verb{"status", "", Role::Look, status},
    Verb{"calibrate", "", Role::Change, calibrate},
    Verb{"cancel", "", Role::Change, cancel},
    Verb{"reference", "here", Role::Change, reference_here},
    Verb{"reference", "cancel", Role::Change, cancel_reference},
    Verb{"reference", "", Role::Change, reference},
    Verb{"verification", "", Role::Look, verification},
    Verb{"touch", "cancel", Role::Look, cancel_touching},  // whoever sees a machine move may stop it
    Verb{"touch", "where", Role::Look, where_it_stands},
    Verb{"touch", "", Role::Move, touch},
    Verb{"touches", "", Role::Move, touches},  // without it a movement ends
    Verb{"machine", "release", Role::Move, release_machine},
    Verb{"machine", "stop", Role::Look, stop_machine},
    Verb{"machine", "", Role::Look, machine},
    Verb{"tracker", "", Role::Move, tracker_order},
    Verb{"tracker_reflectors", "", Role::Look, tracker_reflectors},
};

std::string known_verbs() {
  std::vector<std::string_view> names;
  for (const Verb& verb : kVerbs)
    if (verb.member.empty()) names.push_back(verb.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

Result<const Verb*> verb_of(const json& request) {
  const auto what = request.at("do").get<std::string>();
  for (const Verb& verb : kVerbs)
    if (verb.name == what && (verb.member.empty() || request.value(std::string{verb.member}, false)))
      return &verb;
  return fail(ErrorCode::Usage, fmt::format("unknown request \"{}\": known are {}", what, known_verbs()));
}

/// What to run for it, if `peer` may.
Result<Verb::Task> task_of(const json& request, const ControlPeer& peer, const ControlConfig& control) {
  const auto verb = verb_of(request);
  if (!verb) return tl::unexpected(verb.error());
  if (const auto may = check_role(peer, (*verb)->role, (*verb)->name, control); !may)
    return tl::unexpected(may.error());
  return (*verb)->task;
}

}  // namespace

std::vector<ControlVerb> control_verbs() {
  std::vector<ControlVerb> all;
  for (const Verb& verb : kVerbs)
    all.push_back({std::string{verb.name}, std::string{verb.member}, verb.role});
  return all;
}

json answer_on_hub(const Hub& hub, const json& request, const ControlPeer& peer) {
  const auto task = task_of(request, peer, hub.parts().config.control);
  if (!task) return refusal(task.error());
  const auto on_hub = (*task)(hub.parts(), request);
  return on_hub ? (*on_hub)(hub)() : refusal(on_hub.error());
}

json answer_request(Hub& hub, const json& request, const ControlPeer& peer,
                    std::chrono::milliseconds time_out) {
  const auto task = task_of(request, peer, hub.parts().config.control);
  if (!task) return refusal(task.error());
  auto on_hub = (*task)(hub.parts(), request);
  if (!on_hub) return refusal(on_hub.error());
  const auto answer = hub.call([&hub, run = std::move(*on_hub)] { return run(hub); }, time_out);
  return answer ? (*answer)()
                : refusal({ErrorCode::Io, fmt::format("the hub did not answer in {} ms", time_out.count())});
}

}  // namespace abbe::daemon
