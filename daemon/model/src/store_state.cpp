#include "store_state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <nlohmann/json.hpp>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

namespace {

using nlohmann::json;

constexpr std::string_view kSchema = "abbe/store/1";
constexpr std::array<std::string_view, 6> kActions{"added",       "activated", "forced",
                                                   "rolled-back", "drifted",   "removed"};

bool is_activation(const StoreEvent& event) {
  return event.action == StoreAction::Activated || event.action == StoreAction::Forced ||
         event.action == StoreAction::RolledBack;
}

std::string accepted_configuration(const std::vector<StoreEvent>& events, std::string_view id) {
  const auto last = std::find_if(events.rbegin(), events.rend(), [&](const StoreEvent& event) {
    return event.id == id && !event.accepted_configuration.empty();
  });
  return last == events.rend() ? std::string{} : last->accepted_configuration;
}

json to_json(const StoreEvent& event) {
  json object{{"action", kActions[static_cast<std::size_t>(event.action)]},
              {"id", event.id},
              {"who", event.actor.who},
              {"why", event.actor.why},
              {"when", to_text(event.actor.when)}};
  if (!event.accepted_configuration.empty())
    object["accepted_configuration"] = event.accepted_configuration;
  if (event.action == StoreAction::Added) {
    object["accepted"] = event.accepted;
    object["reasons"] = event.reasons;
  }
  return object;
}

/// The event in one object of state.json. nullopt for an unknown action or a malformed time. Throws
/// json::exception if a member is missing or has the wrong type.
std::optional<StoreEvent> event_from(const json& object) {
  const auto action =
      std::find(kActions.begin(), kActions.end(), object.at("action").get<std::string>());
  const auto when = utc_from_text(object.at("when").get<std::string>());
  if (action == kActions.end() || !when) return std::nullopt;
  StoreEvent event;
  event.action = static_cast<StoreAction>(action - kActions.begin());
  event.id = object.at("id").get<std::string>();
  event.actor = {object.at("who").get<std::string>(), object.at("why").get<std::string>(), *when};

  event.accepted_configuration = object.value("accepted_configuration", std::string{});
  if (event.action == StoreAction::Added) {
    event.accepted = object.at("accepted").get<bool>();
    event.reasons = object.at("reasons").get<std::vector<std::string>>();
  }

  return event;
}

}  // namespace

std::vector<std::string> StoreState::activations() const {
  std::vector<std::string> stack;
  for (const auto& event : events) {
    if (!is_activation(event)) continue;
    if (event.action == StoreAction::RolledBack)
      while (!stack.empty() && stack.back() != event.id) stack.pop_back();
    // A repeated activation of the active model does not count as a new activation.
    if (stack.empty() || stack.back() != event.id) stack.push_back(event.id);
  }
  return stack;
}

std::optional<std::string> StoreState::active() const {
  const auto stack = activations();
  return stack.empty() ? std::nullopt : std::optional{stack.back()};
}

std::optional<StoreEvent> StoreState::activation() const {
  const auto id = active();
  if (!id) return std::nullopt;
  const auto last = std::find_if(events.rbegin(), events.rend(), is_activation);
  StoreEvent event = *last;
  const StoreEvent* added = last_added(*id);
  event.accepted = added != nullptr && added->accepted;
  if (added != nullptr && !added->accepted) event.reasons = added->reasons;
  event.accepted_configuration = accepted_configuration(events, *id);
  return event;
}

std::string StoreState::drift() const {
  for (auto event = events.rbegin(); event != events.rend() && !is_activation(*event); ++event)
    if (event->action == StoreAction::Drifted) return event->actor.why;
  return {};
}

const StoreEvent* StoreState::last_added(std::string_view id) const {
  const auto found = std::find_if(events.rbegin(), events.rend(), [&](const StoreEvent& event) {
    return (event.action == StoreAction::Added || event.action == StoreAction::Removed) &&
           event.id == id;
  });
  return found == events.rend() || found->action == StoreAction::Removed ? nullptr : &*found;
}

std::unordered_map<std::string_view, const StoreEvent*> StoreState::models() const {
  std::unordered_map<std::string_view, const StoreEvent*> last;
  for (const auto& event : events)
    if (event.action == StoreAction::Added || event.action == StoreAction::Removed)
      last[event.id] = &event;
  return last;
}

std::vector<std::string> StoreState::beyond(const ModelRetention& retention,
                                            protocol::UtcTime now) const {
  std::vector<const StoreEvent*> added;
  for (const auto& [id, event] : models())
    if (event->action == StoreAction::Added) added.push_back(event);
  // the pointers point into `events`, so this is the order in which the models were added
  std::ranges::sort(added, std::less<>{});
  if (added.size() <= retention.keep_newest) return {};
  added.resize(added.size() - retention.keep_newest);

  std::vector<std::string> ids;
  const auto in_force = activations();
  for (const StoreEvent* event : added)
    if (event->actor.when + retention.keep <= now && std::ranges::count(in_force, event->id) == 0)
      ids.push_back(event->id);
  return ids;
}

std::string to_text(const StoreState& state) {
  json events = json::array();
  for (const auto& event : state.events) events.push_back(to_json(event));
  const auto active = state.active();
  json root{{"schema", kSchema},
            {"active", active ? json(*active) : json()},
            {"events", std::move(events)}};
  return indented_json_text(root) + "\n";
}

Result<StoreState> store_state_from_text(std::string_view text, const std::string& file) {
  // These limits are sufficient for one event per hour over the life of a machine, and for the
  // nesting depth that to_text() writes.
  const auto parsed =
      parse_json(text, file, {.bytes = 256u << 20, .depth = 8, .values = 20'000'000});
  ABBE_TRY(parsed);
  const json& root = *parsed;

  try {
    if (root.at("schema").get<std::string>() != kSchema)
      return fail(ErrorCode::BadInput, fmt::format("{}: schema must be \"{}\"", file, kSchema));
    StoreState state;
    for (const auto& object : root.at("events")) {
      auto event = event_from(object);
      if (!event)
        return fail(ErrorCode::BadInput,
                    fmt::format("{}: event {}: unknown action or time", file, state.events.size()));
      state.events.push_back(std::move(*event));
    }
    return state;
  } catch (const json::exception& exception) {
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", file, cause_of(exception)));
  }
}

}  // namespace abbe::daemon
