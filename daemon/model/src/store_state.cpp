#include "store_state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/utc_text.hpp"

namespace abbe::daemon {

namespace {

using nlohmann::json;

constexpr std::string_view kSchema = "abbe/store/1";
constexpr std::array<std::string_view, 5> kActions{"added", "activated", "forced", "rolled-back",
                                                   "drifted"};

bool is_activation(const StoreEvent& event) {
  return event.action != StoreAction::Added && event.action != StoreAction::Drifted;
}

json to_json(const StoreEvent& event) {
  json object{{"action", kActions[static_cast<std::size_t>(event.action)]},
              {"id", event.id},
              {"who", event.actor.who},
              {"why", event.actor.why},
              {"when", to_text(event.actor.when)}};
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
  return event;
}

std::string StoreState::drift() const {
  for (auto event = events.rbegin(); event != events.rend() && !is_activation(*event); ++event)
    if (event->action == StoreAction::Drifted) return event->actor.why;
  return {};
}

const StoreEvent* StoreState::last_added(std::string_view id) const {
  const auto found = std::find_if(events.rbegin(), events.rend(), [&](const StoreEvent& event) {
    return event.action == StoreAction::Added && event.id == id;
  });
  return found == events.rend() ? nullptr : &*found;
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
  if (!parsed) return tl::make_unexpected(parsed.error());
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
