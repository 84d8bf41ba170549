#include "abbe/service/control_api.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/config/linear_axes.hpp"
#include "abbe/model/configuration_fit.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/store_changes.hpp"
#include "motion_requests.hpp"
#include "status_reply.hpp"
#include "tracker_requests.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

Result<OnHub> status(const HubParts&, const json&) {
  return status_reply;
}

Result<OnHub> live(const HubParts&, const json&) {
  return live_reply;
}

json request_json(std::uint64_t session, const std::shared_ptr<const std::string>& text) {
  json out{{"ok", true}, {"session", session}};
  if (text == nullptr) return out;
  out["request"] = json::parse(*text);
  return out;
}

/// The request of the present or last session, with its path or artefact.
Result<OnHub> calibration(const HubParts&, const json&) {
  return [](const Hub& hub) -> Reply {
    const CalibrationSession& session = hub.parts().calibration.session();
    return [id = session.status().id, text = session.request_text()] {
      return request_json(id, text);
    };
  };
}

constexpr std::size_t kLongestName = 64, kLongestReason = 500;

/// The remark of a client, at most `most` bytes and without control characters, because it is shown
/// on terminals, written to the journal and kept in the store.
std::string remark_of(std::string who, std::size_t most = kLongestName) {
  if (who.size() > most) {
    std::size_t end = most;  // moved to the start of a UTF-8 character
    while (end > 0 && (static_cast<unsigned char>(who[end]) & 0xc0) == 0x80) --end;
    who.replace(end, std::string::npos, "...");
  }
  std::ranges::replace_if(
      who, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return who;
}

/// The user who sent the request, as the kernel reports it. A name that the client states itself
/// (for example the operator behind a service) is added as a remark.
std::string who(const json& request) {
  const auto user = request.value("user", std::string{"unknown"});
  const auto remark = remark_of(request.value("who", std::string{}));
  return remark.empty() || remark == user ? user : fmt::format("{} (as {})", user, remark);
}

/// Refused if the method needs readings of X, Y and Z and one of these axes is not referenced: the
/// run would wait for readings forever.
Result<void> check_zeros(const HubParts& parts, const MethodNeeds& needs) {
  if (parts.reference == nullptr || !needs.axis_readings) return {};
  auto unknown = parts.reference->unknown();
  const auto linear = std::span{parts.config.machine.axes}.first(
      std::min(kLinearAxes, parts.config.machine.axes.size()));

  std::erase_if(unknown, [&linear](const std::string& name) {
    return std::ranges::find(linear, name, &AxisConfig::name) == linear.end();
  });

  if (unknown.empty()) return {};
  return fail(
      ErrorCode::Refused,
      fmt::format(
          "calibrate: {} {} not referenced: run `abbe reference` to find the reference "
          "marks, or `abbe reference --here` to state that the axes read their offset now",
          unknown.size() == 1 ? "axis" : "axes",
          fmt::format("{} {}", fmt::join(unknown, ", "), unknown.size() == 1 ? "is" : "are")));
}

/// Refused while the tracker executes an order: a run must not contain points from before and after
/// an order.
Result<void> check_tracker_is_free(const HubParts& parts, const MethodNeeds& needs) {
  const auto* order = parts.tracker != nullptr ? parts.tracker->running() : nullptr;
  if (order == nullptr || !needs.tracker) return {};
  return fail(
      ErrorCode::Refused,
      fmt::format(
          "calibrate: the tracker carries out \"{}\" for {}: wait until it has ended (see `abbe "
          "tracker status`)",
          drivers::name_of(order->asked.what), order->by));
}

Result<OnHub> calibrate(const HubParts& parts, const json& request) {
  auto task = task_from_json(request, &parts.config);
  ABBE_TRY(task);
  auto prepared = parts.calibration.prepare(std::move(*task));
  ABBE_TRY(prepared);
  auto shared = std::make_shared<PreparedCalibration>(std::move(*prepared));

  return [shared, by = who(request)](const Hub& hub) {
    const HubParts& on = hub.parts();
    if (const auto known = check_zeros(on, shared->needs); !known) return reply(known.error());
    if (const auto free = check_tracker_is_free(on, shared->needs); !free)
      return reply(free.error());
    const auto started = on.calibration.start(std::move(*shared), by, on.time.now());
    return started ? reply(json{{"ok", true}, {"session", *started}}) : reply(started.error());
  };
}

/// Longest wait for the store. It is long enough for a store whose lock is free, and short enough
/// for a stop request that waits behind it.
constexpr std::chrono::milliseconds kStorePatience{50};

/// {"id": of the active model, or of the added one} if the change is done; {"change": number} while
/// it runs. `patience`: meanwhile no other client of the control socket gets an answer.
Result<OnHub> answer_change(StoreChanges& changes, const Result<std::uint64_t>& number,
                            std::chrono::milliseconds patience = kStorePatience) {
  ABBE_TRY(number);
  const auto outcome = changes.outcome(*number, patience);
  json answer{{"ok", true}, {"change", *number}};
  if (outcome) {
    if (!*outcome) return tl::unexpected(outcome->error());
    answer["id"] = **outcome;
  }
  return [answer](const Hub&) { return reply(answer); };
}

Result<StoreChanges*> changes_of(const HubParts& parts) {
  if (parts.store_changes != nullptr) return parts.store_changes;
  return fail(ErrorCode::Refused, "this daemon changes no models");
}

Result<OnHub> activate(const HubParts& parts, const json& request) {
  const auto changes = changes_of(parts);
  ABBE_TRY(changes);
  return answer_change(
      **changes,
      (*changes)->activate({.id = request.at("id").get<std::string>(),
                            .who = who(request),
                            .why = remark_of(request.value("why", std::string{}), kLongestReason),
                            .force = request.value("force", false)}));
}

Result<OnHub> add(const HubParts& parts, const json& request) {
  const auto changes = changes_of(parts);
  ABBE_TRY(changes);
  return answer_change(
      **changes,
      (*changes)->add({.model = request.at("model").get<std::string>(),
                       .present = present_configuration(parts.config),
                       .who = who(request),
                       .why = remark_of(request.value("why", std::string{}), kLongestReason)}));
}

Result<OnHub> rollback(const HubParts& parts, const json& request) {
  const auto changes = changes_of(parts);
  ABBE_TRY(changes);
  return answer_change(
      **changes, (*changes)->roll_back(
                     {.active = request.at("active").get<std::string>(),
                      .who = who(request),
                      .why = remark_of(request.value("why", std::string{}), kLongestReason)}));
}

Result<OnHub> change(const HubParts& parts, const json& request) {
  const auto changes = changes_of(parts);
  ABBE_TRY(changes);
  return answer_change(**changes, request.at("number").get<std::uint64_t>(),
                       std::chrono::milliseconds{0});  // a client may ask repeatedly
}

Result<OnHub> cancel(const HubParts&, const json& request) {
  return [by = who(request)](const Hub& hub) {
    return reply_done(hub.parts().calibration.cancel(by, hub.parts().time.now()));
  };
}

SetZeroHere stand_here(const HubParts& parts, const std::vector<std::string>& axes, double u) {
  SetZeroHere here{.axes = axes, .u = u, .now = parts.time.now()};
  here.patience = parts.time.host(here.patience);
  here.acquiring = takes_readings(parts.calibration.session().status().state);
  return here;
}

OnHub with_reference(std::function<Result<void>(ReferenceService&, const HubParts&)> task) {
  return [task = std::move(task)](const Hub& hub) {
    ReferenceService* const service = hub.parts().reference;
    return service == nullptr ? reply(Error{ErrorCode::Refused, "reference: not in this daemon"})
                              : reply_done(task(*service, hub.parts()));
  };
}

/// The axes that a request names. The hub compares them with those of the counter card, so there
/// are at most as many as a card counts.
Result<std::vector<std::string>> axes_of(const json& request) {
  const auto named = request.find("axes");
  if (named == request.end()) return {};
  if (named->is_array() && named->size() > protocol::kMaxAxes)
    return fail(ErrorCode::Usage,
                fmt::format("reference: {} axes are named: at most {} are counted", named->size(),
                            protocol::kMaxAxes));
  auto axes = named->get<std::vector<std::string>>();
  for (auto& name : axes) name = remark_of(std::move(name));
  return axes;
}

Result<OnHub> reference_here(const HubParts&, const json& request) {
  auto axes = axes_of(request);
  ABBE_TRY(axes);
  return with_reference([axes = std::move(*axes), u = request.value("u", SetZeroHere::kByEye)](
                            ReferenceService& service, const HubParts& parts) {
    return service.set_zero_here(stand_here(parts, axes, u));
  });
}

Result<OnHub> cancel_reference(const HubParts&, const json&) {
  return with_reference(
      [](ReferenceService& service, const HubParts&) { return service.cancel(); });
}

Result<OnHub> reference(const HubParts&, const json&) {
  return with_reference([](ReferenceService& service, const HubParts&) { return service.start(); });
}

Result<OnHub> accept_sensor(const HubParts&, const json& request) {
  SensorAcceptance acceptance{
      .sensor = remark_of(request.at("sensor").get<std::string>()),
      .who = who(request),
      .why = remark_of(request.value("why", std::string{}), kLongestReason)};
  return [acceptance = std::move(acceptance)](const Hub& hub) {
    const HubParts& on = hub.parts();
    if (on.sensors == nullptr)
      return reply(Error{ErrorCode::Refused, "sensors accept: not in this daemon"});
    SensorAcceptance now = acceptance;
    now.from = on.time.now();
    return reply_done(on.sensors->accept(hub.live(), std::move(now),
                                         takes_readings(on.calibration.session().status().state)));
  };
}

json point_json(const StandstillPoint& p) {
  const auto list = [](const calib::Vector3& v) { return json{v.x(), v.y(), v.z()}; };
  return {{"reading_m", list(p.mean.reading_m)},
          {"tracker_m", list(p.mean.measured_m)},
          {"tracker_points", p.tracker_points},
          {"scatter_m", p.scatter_m}};
}

/// Points of a verification from the requested index on, as copied on the hub's thread.
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
  return number ? reply(json{{"ok", true}, {"number", *number}, {"machine", service.machine()}})
                : reply(number.error());
}

Reply look_at_verification(VerificationService& service, std::uint64_t number, std::size_t from,
                           bool end) {
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

/// {"step": "begin"} returns the number of the verification and the name of the machine. {"step":
/// "look" | "end", "number": .., "from": k} returns the points from index k on; with "end", the
/// present standstill becomes the last point first.
Result<OnHub> verification(const HubParts& parts, const json& request) {
  if (parts.verification == nullptr) return fail(ErrorCode::Refused, "verify: not in this daemon");
  const auto step = request.at("step").get<std::string>();
  if (step == "begin")
    return [](const Hub& hub) { return begin_verification(*hub.parts().verification); };
  if (step != "end" && step != "look")
    return fail(ErrorCode::Usage, fmt::format("verification: unknown step {}", step));
  return [number = request.at("number").get<std::uint64_t>(),
          from = request.value("from", std::size_t{0}), end = step == "end"](const Hub& hub) {
    return look_at_verification(*hub.parts().verification, number, from, end);
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
  ABBE_TRY(order);
  return give_tracker(std::move(*order), who(request));
}

Result<OnHub> tracker_reflectors(const HubParts&, const json& request) {
  return give_tracker({.what = drivers::TrackerOrder::What::ListReflectors}, who(request));
}

/// One kind of request. The constructor makes it impossible to leave out the role.
struct Verb {
  using Task = Result<OnHub> (*)(const HubParts&, const json&);
  constexpr Verb(std::string_view does, std::string_view with, Role needs, Task runs)
      : name(does), member(with), role(needs), task(runs) {}

  std::string_view name;
  std::string_view member;  ///< matches if this member of the request is true; empty: always
  Role role;
  Task task;
};

// The only table of requests. A request is executed with the task and the role of the first row
// that matches it.
constexpr std::array kVerbs{
    Verb{"status", "", Role::Look, status},
    Verb{"live", "", Role::Look, live},
    Verb{"calibration", "", Role::Look, calibration},
    Verb{"calibrate", "", Role::Change, calibrate},
    Verb{"cancel", "", Role::Change, cancel},
    Verb{"reference", "here", Role::Change, reference_here},
    Verb{"reference", "cancel", Role::Change, cancel_reference},
    Verb{"reference", "", Role::Change, reference},
    Verb{"sensors", "accept", Role::Change, accept_sensor},
    Verb{"activate", "", Role::Change, activate},
    Verb{"add", "", Role::Change, add},
    Verb{"rollback", "", Role::Change, rollback},
    Verb{"change", "", Role::Look, change},
    Verb{"verification", "", Role::Look, verification},
    Verb{"touch", "cancel", Role::Look, cancel_touching},  // the role Look is enough for a stop
    Verb{"touch", "where", Role::Look, where_it_stands},
    Verb{"touch", "", Role::Move, begin_touching},
    // Move, because this request lets a motion continue
    Verb{"touches", "", Role::Move, look_at_touches},
    Verb{"machine", "release", Role::Move, release_machine},
    Verb{"machine", "stop", Role::Look, stop_machine},
    Verb{"machine", "", Role::Look, machine_state},
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
    if (verb.name == what &&
        (verb.member.empty() || request.value(std::string{verb.member}, false)))
      return &verb;
  return fail(ErrorCode::Usage,
              fmt::format("unknown request \"{}\": known are {}", what, known_verbs()));
}

/// The task for the request. Refused if `peer` does not have the role that the request requires.
Result<Verb::Task> task_of(const json& request, const ControlPeer& peer, const HubParts& parts) {
  if (parts.network_user && peer.uid == *parts.network_user && peer.uid != 0)
    return fail(ErrorCode::Refused,
                fmt::format("{} is the user of abbe-dds, which reads the network: it may request "
                            "nothing here",
                            peer.user));
  const auto verb = verb_of(request);
  ABBE_TRY(verb);
  ABBE_TRY(check_role(peer, (*verb)->role, (*verb)->name, parts.config.control));
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
  const auto task = task_of(request, peer, hub.parts());
  if (!task) return refusal(task.error());
  const auto on_hub = (*task)(hub.parts(), request);
  return on_hub ? (*on_hub)(hub)() : refusal(on_hub.error());
}

json answer_request(Hub& hub, const json& request, const ControlPeer& peer,
                    std::chrono::milliseconds time_out) {
  const auto task = task_of(request, peer, hub.parts());
  if (!task) return refusal(task.error());
  auto on_hub = (*task)(hub.parts(), request);
  if (!on_hub) return refusal(on_hub.error());
  const auto answer = hub.call([&hub, run = std::move(*on_hub)] { return run(hub); }, time_out);
  return answer ? (*answer)()
                : refusal({ErrorCode::Io,
                           fmt::format("the hub did not answer within {} ms", time_out.count())});
}

}  // namespace abbe::daemon
