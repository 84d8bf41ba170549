#include "abbe/notify/state_changes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <string_view>
#include <utility>

#include "abbe/base/status_conditions.hpp"

namespace abbe::notify {
namespace {

using daemon::Level;
using daemon::Raised;
using nlohmann::json;

constexpr const char* kModelSubject = "model";
constexpr const char* kDaemonSubject = "abbed";

Severity severity_of(Level level) {
  return level == Level::Fault ? Severity::Fault : Severity::Warning;
}

/// True if the calibration was accepted or refused. A calibration that a person cancelled has no
/// verdict.
bool has_verdict(const json& session) {
  const auto state = session.at("state").get<std::string>();
  if (state == "active") return true;
  return state == "refused" && !session.at("reason").get<std::string>().starts_with("cancelled");
}

bool has_ended(const json& session) {
  const auto state = session.at("state").get<std::string>();
  return state == "active" || state == "refused";
}

/// All calibrations in the answer that have ended, by number.
std::map<std::uint64_t, json> ended_sessions(const json& status) {
  std::map<std::uint64_t, json> out;
  for (const json& session : status.value("ended_sessions", json::array()))
    if (has_ended(session)) out[session.at("id").get<std::uint64_t>()] = session;
  const json& present = status.at("session");
  if (has_ended(present)) out[present.at("id").get<std::uint64_t>()] = present;
  return out;
}

/// The text of a verdict as on the page: "Calibration refused: REASON". The word is not repeated if
/// the reason begins with it, as most reasons do.
std::string text_of_verdict(std::string_view word, const std::string& reason) {
  return reason.starts_with(word) ? fmt::format("Calibration {}", reason)
                                  : fmt::format("Calibration {}: {}", word, reason);
}

Event event_of_verdict(const json& session) {
  const bool accepted = session.at("state") == "active";
  const auto number = session.at("id").get<std::uint64_t>();
  return {.kind = accepted ? NotifyKind::CalibrationAccepted : NotifyKind::CalibrationRefused,
          .severity = accepted ? Severity::Info : Severity::Warning,
          .subject = fmt::format("calibration {}", number),
          .text = text_of_verdict(accepted ? "accepted" : "refused",
                                  session.at("reason").get<std::string>()),
          .model_id = session.value("model_id", std::string{}),
          .session = number};
}

/// An action that a calibration requests of the person at the machine.
struct Demand {
  NotifyKind kind = NotifyKind::PersonNeeded;
  Severity severity = Severity::Info;
  std::string key{};  ///< a different key means a different request
  std::string text{};
};

/// The present position of an array, or the present measurement of a bar. Its balls and features
/// are not reported one by one, because the person who touches them is at the machine.
std::string place_of(const json& next) {
  if (next.contains("measurement")) return next.at("measurement").get<std::string>();
  return fmt::format("{}", next.at("position").get<std::int64_t>());
}

std::optional<Demand> demand_of(const json& session) {
  const auto number = session.at("id").get<std::uint64_t>();
  const auto reason = session.at("reason").get<std::string>();
  const json start = session.value("start", json::object());
  if (start.value("missed", false))
    return Demand{NotifyKind::StartMissed, Severity::Warning, fmt::format("missed {}", number),
                  reason};
  if (start.value("ready", false))
    return Demand{NotifyKind::PersonNeeded, Severity::Info, fmt::format("ready {}", number),
                  "READY: drive the path now"};
  if (session.contains("next"))
    return Demand{NotifyKind::PersonNeeded, Severity::Info,
                  fmt::format("next {} {}", number, place_of(session.at("next"))), reason};
  return std::nullopt;
}

/// The text of a model's state: "model 886b7a59495fc140: STALE: no axis positions yet".
std::string text_of_model(const json& model) {
  const auto id = model.value("id", std::string{});
  return fmt::format("{}: {}: {}", id.empty() ? "active model" : "model " + id,
                     model.at("state").get<std::string>(), model.at("reason").get<std::string>());
}

/// The text of the end of a state: "tracker: streaming".
std::string text_of_end(const std::string& subject, const json& status) {
  if (subject == kModelSubject) return text_of_model(status.at("model"));
  for (const json& stream : status.at("streams"))
    if (stream.at("name") == subject)
      return fmt::format("{}: {}", subject, stream.at("state").get<std::string>());
  return fmt::format("{}: is not configured any more", subject);
}

}  // namespace

std::vector<Event> StateChanges::take(const daemon::DaemonPoll::Answer& answer, Moment now) {
  if (!answer) return away(answer.error().text, now);
  try {
    return answered(*answer, now);
  } catch (const std::exception& error) {
    return away(fmt::format("the answer of abbed is not that of this version: {}", error.what()),
                now);
  }
}

std::vector<Event> StateChanges::answered(const json& status, Moment now) {
  std::vector<Event> out;
  see_process(status, now, out);
  see_ended_sessions(status, out);
  see_demands(status, out);
  if (now.steady >= settled_at_) see_lasting(status, out);
  first_answer_ = false;

  const bool simulated = status.value("simulated", false);
  for (Event& event : out) {
    event.time = now.utc;
    event.simulated = simulated;
  }
  return out;
}

std::vector<Event> StateChanges::away(const std::string& fault, Moment now) {
  if (!away_since_) away_since_ = now.steady;
  if (away_reported_ || now.steady - *away_since_ < settle_) return {};
  away_reported_ = true;
  return {{.kind = NotifyKind::NotReachable,
           .phase = Phase::Begins,
           .severity = Severity::Fault,
           .subject = kDaemonSubject,
           .text = fault,
           .time = now.utc}};
}

/// Evaluates which process answered: abbed answers again, or another process of it answers.
void StateChanges::see_process(const json& status, Moment now, std::vector<Event>& out) {
  const int process = status.at("process").get<int>();
  const bool restarted = process_ && *process_ != process;
  if (away_reported_)
    out.push_back({.kind = NotifyKind::NotReachable,
                   .phase = Phase::Ends,
                   .subject = kDaemonSubject,
                   .text = "abbed answers"});
  else if (restarted)
    out.push_back({.kind = NotifyKind::NotReachable,
                   .severity = Severity::Warning,
                   .subject = kDaemonSubject,
                   .text = "abbed restarted"});
  away_reported_ = false;
  away_since_.reset();

  if (process_ == process) return;
  process_ = process;
  settled_at_ = now.steady + settle_;
  last_session_ = 0;  // abbed counts calibrations anew after each start
  demand_.clear();
}

void StateChanges::see_ended_sessions(const json& status, std::vector<Event>& out) {
  for (const auto& [number, session] : ended_sessions(status)) {
    if (number <= last_session_) continue;
    last_session_ = number;
    if (!first_answer_ && has_verdict(session)) out.push_back(event_of_verdict(session));
  }
}

void StateChanges::see_demands(const json& status, std::vector<Event>& out) {
  const json& session = status.at("session");
  const auto demand = demand_of(session);
  const std::string key = demand ? demand->key : "";
  const bool is_wrong = demand && demand->kind == NotifyKind::StartMissed;
  if (demand && key != demand_ && (!first_answer_ || is_wrong))
    out.push_back({.kind = demand->kind,
                   .severity = demand->severity,
                   .subject = key,
                   .text = demand->text,
                   .session = session.at("id").get<std::uint64_t>()});
  demand_ = key;

  const auto system = daemon::system_condition(status);
  const auto release = system.find("release");
  const std::string reason = release != system.end() ? release->second.text : "";
  if (!reason.empty() && reason != release_)
    out.push_back({.kind = NotifyKind::PersonNeeded,
                   .severity = severity_of(release->second.level),
                   .subject = "release",
                   .text = reason});
  release_ = reason;
}

StateChanges::AllLasting StateChanges::lasting_in(const json& status) {
  AllLasting out;
  const auto add = [&out](NotifyKind kind, const std::string& name, const Raised& raised) {
    const Severity severity = severity_of(raised.level);
    out[name] = {.kind = kind,
                 .severity = severity,
                 .state = std::string{name_of(severity)},
                 .text = fmt::format("{}: {}", name, raised.text),
                 .model_id = {}};
  };
  for (const auto& [name, raised] : daemon::device_condition(status))
    add(NotifyKind::DeviceLost, name, raised);
  for (const auto& [name, raised] : daemon::system_condition(status))
    if ((name == "recorder" || name == "models") && raised.level == Level::Fault)
      add(NotifyKind::StorageFailed, name, raised);

  const json& model = status.at("model");
  const auto state = model.at("state").get<std::string>();
  if (state == "ACTIVE") had_model_ = true;
  // A machine that has no model yet is not a fault.
  if (state == "ACTIVE" || (state == "NONE" && !had_model_)) return out;
  const auto id = model.value("id", std::string{});
  out[kModelSubject] = {.kind = state == "DRIFT" ? NotifyKind::Drift : NotifyKind::ModelNotValid,
                        .severity = state == "INVALID" ? Severity::Fault : Severity::Warning,
                        .state = fmt::format("{} {}", state, id),
                        .text = text_of_model(model),
                        .model_id = id};
  return out;
}

void StateChanges::see_lasting(const json& status, std::vector<Event>& out) {
  AllLasting present = lasting_in(status);
  for (const auto& [subject, was] : lasting_)
    if (!present.contains(subject))
      out.push_back({.kind = was.kind,
                     .phase = Phase::Ends,
                     .subject = subject,
                     .text = text_of_end(subject, status),
                     .model_id = was.model_id});

  for (auto& [subject, is] : present) {
    const auto was = lasting_.find(subject);
    if (was != lasting_.end() && was->second.state == is.state) continue;
    out.push_back({.kind = is.kind,
                   .phase = Phase::Begins,
                   .severity = is.severity,
                   .subject = subject,
                   .text = is.text,
                   .model_id = is.model_id});
  }
  lasting_ = std::move(present);
}

}  // namespace abbe::notify
