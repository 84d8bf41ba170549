#include "abbe/service/state_observer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::daemon {

struct ObservedPart {
  std::string key;    ///< identifies the part
  std::string state;  ///< a change gives a journal entry
  std::string message;
  std::string_view message_id;
  Urgency urgency = Urgency::Info;
  std::vector<JournalField> fields = {};
  std::uint64_t counted = 0;  ///< an increase gives an entry, once per kCountPeriod
};

namespace {

// One MESSAGE_ID for each kind of part, made with `journalctl --new-id128`.
constexpr std::string_view kDeviceId = "5f0c8a7be4f94c0f9d0e6a3f1b7c2d41";
constexpr std::string_view kRecorderId = "8d3b1f6a27c54e0b9a4f7c5e2d1a6b93";
constexpr std::string_view kStoreId = "c1e7d0948b3a4f52a6f0b9d47e5c8132";
constexpr std::string_view kLinkId = "2b9f64d1c08e4a7785d3e1f6a4b0c957";
constexpr std::string_view kIdentityId = "0f6b8f3c1c5e4b0fa7d2f4b2f1e09a6d";
constexpr std::string_view kSecurityId = "4ac1f08b65d24e3d9b7f20e6c85a31d4";
constexpr std::string_view kSessionId = "e84a05c3f1d74b9c92b6d7e30f5a1c68";
constexpr std::string_view kModelId = "93d6f7b20a4c4e81b5e9c20d8f1a7346";
constexpr std::string_view kParticipantId = "70c5e2a9d6b84f13a1d4f8067b3e9c25";
constexpr std::string_view kStopId = "3ed07b5c94f14d6a8b12e7f05a6c8d9e";
constexpr std::string_view kHubId = "b64f1d83e7a0495c8e2b0c9f53d7a61e";

struct StreamKind {
  std::string_view word, message_id, remedy;
  Urgency when_bad;
};

StreamKind kind_of(const std::string& stream) {
  if (stream == "recorder")
    return {"", kRecorderId, "check space and permissions of [recording] dir", Urgency::Error};
  if (stream == "models")
    return {"", kStoreId, "check the files in models below [daemon] data_dir", Urgency::Error};
  if (stream == "dds")
    return {"link to ", kLinkId,
            "nothing is published until abbe-dds connects and answers: see its own log lines",
            Urgency::Warning};
  if (stream == "dds_security")
    return {"", kSecurityId, "anyone on the domain can publish as this machine", Urgency::Warning};

  if (stream == "identity")
    return {"", kIdentityId, "see `abbe machine identity`", Urgency::Warning};

  return {"device ", kDeviceId,
          "check its power, its cable and its table in the configuration; abbed tries again",
          Urgency::Warning};
}

ObservedPart part_of(const StreamHealth& stream) {
  const auto& d = stream.status;
  const StreamKind kind = kind_of(d.name);
  const std::uint64_t lost = d.dropped + d.raw_dropped;
  ObservedPart part{
      .key = "stream " + d.name,
      .state = fmt::format("{}\n{}\n{}\n{}", d.state, d.connected, d.condition, d.last_fault),
      .message = fmt::format("{}{}: {}", kind.word, d.name, d.state),
      .message_id = kind.message_id,
      .urgency = d.connected && d.last_fault.empty() && d.condition.empty() ? Urgency::Info
                                                                            : kind.when_bad,
      .fields = {{"ABBE_DEVICE", d.name},
                 {"ABBE_STATE", std::string{d.state}},
                 {"ABBE_FAULTS", std::to_string(d.faults)},
                 {"ABBE_LOST", std::to_string(lost)},
                 {"ABBE_GAPS", std::to_string(d.gaps)}},
      .counted = d.faults + lost};

  if (!d.condition.empty()) {
    part.message += fmt::format("; {}", d.condition);
    part.fields.push_back({"ABBE_CONDITION", d.condition});
  }
  if (!d.last_fault.empty()) {
    part.message += fmt::format("; last fault: {}", d.last_fault);
    part.fields.push_back({"ABBE_FAULT", d.last_fault});
  }

  if (!d.connected) part.message += fmt::format("; {}", kind.remedy);
  return part;
}

Urgency urgency_of(SessionState state) {
  if (state == SessionState::Refused) return Urgency::Warning;
  return state == SessionState::Active ? Urgency::Notice : Urgency::Info;
}

ObservedPart part_of(const SessionStatus& session) {
  const auto state = std::string{name(session.state)};
  ObservedPart part{.key = "session",
                    .state = fmt::format("{}\n{}", session.id, state),
                    .message_id = kSessionId,
                    .urgency = urgency_of(session.state),
                    .fields = {{"ABBE_SESSION", std::to_string(session.id)},
                               {"ABBE_METHOD", session.method},
                               {"ABBE_STATE", state}}};
  part.message = session.id == 0 ? "no calibration yet"
                                 : fmt::format("calibration {} ({}): {}: {}", session.id,
                                               session.method, state, session.reason);
  if (!session.model_id.empty()) part.fields.push_back({"ABBE_MODEL", session.model_id});

  return part;
}

ObservedPart part_of(const ObservedModel& model) {
  const bool bad = model.state == "INVALID" || model.state == "STALE" || model.state == "DRIFT";
  return {
      .key = "model",
      .state = fmt::format("{}\n{}\n{}", model.state, model.id, model.reason),
      .message = fmt::format("{}: {}: {}", model.id.empty() ? "active model" : "model " + model.id,
                             model.state, model.reason),
      .message_id = kModelId,
      .urgency = bad ? Urgency::Warning : Urgency::Notice,
      .fields = {{"ABBE_MODEL", model.id}, {"ABBE_STATE", model.state}}};
}

ObservedPart part_of(const ObservedStop& stop) {
  return {.key = "stop",
          .state = fmt::format("{}\n{}", stop.number, stop.outcome),
          .message = fmt::format(
              "measuring machine: {}{}: {}{}", stop.confirmed ? "" : "stop ", stop.outcome,
              stop.text, stop.confirmed ? "" : "; check the machine, use its emergency stop"),
          .message_id = kStopId,
          .urgency = stop.confirmed ? Urgency::Notice : Urgency::Error,
          .fields = {{"ABBE_STATE", stop.outcome}}};
}

ObservedPart part_of(const ObservedParticipant& participant) {
  ObservedPart part{.key = "participant",
                    .state = fmt::format("{}\n{}", participant.restarts, participant.start_fault),
                    .message = "abbe-dds: started",
                    .message_id = kParticipantId,
                    .fields = {{"ABBE_RESTARTS", std::to_string(participant.restarts)}}};

  const auto ended = [&participant] {
    return participant.last_end.empty() ? std::string{}
                                        : fmt::format("ended: {}; ", participant.last_end);
  };

  if (!participant.start_fault.empty()) {
    part.urgency = Urgency::Error;
    part.message =
        fmt::format("abbe-dds: {}cannot be started again: {}; tried again every few seconds",
                    ended(), participant.start_fault);
    part.fields.push_back({"ABBE_FAULT", participant.start_fault});
  } else if (participant.restarts > 0) {
    part.urgency = Urgency::Warning;
    part.message = fmt::format(
        "abbe-dds: {}started again, {} times since abbed started; for the reason see its own log "
        "lines",
        ended(), participant.restarts);
    part.fields.push_back({"ABBE_FAULT", participant.last_end});
  }

  return part;
}

ObservedPart part_of_hub(bool answers) {
  return {.key = "hub",
          .state = answers ? "answers" : "hangs",
          .message = answers ? "hub: running"
                             : "hub: has not answered for a second; systemd restarts abbed "
                               "if the unit has WatchdogSec=",
          .message_id = kHubId,
          .urgency = answers ? Urgency::Info : Urgency::Error,
          .fields = {{"ABBE_STATE", answers ? "answers" : "hangs"}}};
}

std::vector<ObservedPart> parts_of(const Observed& now) {
  std::vector<ObservedPart> parts{part_of_hub(now.hub_answers)};
  if (now.participant) parts.push_back(part_of(*now.participant));
  if (!now.hub_answers) return parts;
  for (const auto& stream : now.streams) parts.push_back(part_of(stream));
  if (now.stop) parts.push_back(part_of(*now.stop));
  parts.push_back(part_of(now.session));
  parts.push_back(part_of(now.model));
  return parts;
}

}  // namespace

std::vector<JournalEntry> StateObserver::look(const Observed& now, WallTime wall) {
  std::vector<JournalEntry> entries;
  for (const ObservedPart& part : parts_of(now))
    if (auto entry = compare(part, wall)) entries.push_back(std::move(*entry));
  return entries;
}

std::optional<JournalEntry> StateObserver::compare(const ObservedPart& part, WallTime wall) {
  const auto [place, is_new] = reported_.try_emplace(part.key);
  Reported& r = place->second;
  if (is_new) r.refilled_at = wall;
  const double refilled = std::chrono::duration<double>(wall - r.refilled_at) / kRefill;
  r.lines_left = std::min(kBurst, r.lines_left + refilled);
  r.refilled_at = wall;

  const bool changed = std::exchange(r.seen, part.state) != part.state;
  const bool counts_only = part.counted != r.counted && wall - r.logged_at >= kCountPeriod;
  if (part.state == r.logged && r.suppressed == 0 && !counts_only) return std::nullopt;
  if (r.lines_left < 1.0) {
    if (changed) ++r.suppressed;
    return std::nullopt;
  }

  JournalEntry entry{.urgency = part.urgency,
                     .message = part.message,
                     .message_id = part.message_id,
                     .fields = part.fields};
  if (part.counted > r.counted && !r.logged.empty())
    entry.message += fmt::format("; {} faults or lost samples more", part.counted - r.counted);
  // `suppressed` counts changes that were not logged. It may contain the change that is logged now,
  // if that was observed in an earlier call; this change is then not counted as omitted.
  const std::uint64_t is_one_of_them = !changed && part.state != r.logged ? 1 : 0;
  if (const auto left_out = r.suppressed - is_one_of_them; left_out > 0) {
    entry.message += fmt::format("; {} changes before this were not logged", left_out);
    entry.fields.push_back({"ABBE_SUPPRESSED", std::to_string(left_out)});
  }
  entry.fields.push_back({"ABBE_MACHINE", machine_});
  r = {.logged = part.state,
       .seen = part.state,
       .counted = part.counted,
       .lines_left = r.lines_left - 1.0,
       .refilled_at = wall,
       .logged_at = wall};
  return entry;
}

}  // namespace abbe::daemon
