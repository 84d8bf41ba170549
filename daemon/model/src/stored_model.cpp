#include "abbe/model/stored_model.hpp"

#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

/// Adds the verdict of the events to the verdict of the file.
void add_events(std::optional<ModelVerdict>& verdict, const std::vector<StoreEvent>& events) {
  std::optional<StoreActor> forced;
  for (const StoreEvent& event : events) {
    if (event.action == StoreAction::Forced) forced = event.actor;
    if (event.action != StoreAction::Added) continue;
    auto notes = verdict ? std::move(verdict->notes) : std::vector<std::string>{};
    verdict = ModelVerdict{event.accepted, event.reasons, std::move(notes)};
  }
  if (forced && !verdict) verdict = ModelVerdict{.reasons = {"the store has no verdict"}};
  if (verdict && !verdict->accepted) verdict->forced = std::move(forced);
}

StoreEntry entry_of(const ModelDocument& document, const std::vector<StoreEvent>& events) {
  StoreEntry entry{.id = model_id(document),
                   .judged = document.verdict.has_value(),
                   .method = document.method,
                   .machine = document.machine};
  if (document.verdict) {
    entry.accepted = document.verdict->accepted;
    entry.reasons = document.verdict->reasons;
  }
  for (const StoreEvent& event : events)
    if (event.action == StoreAction::Added) entry.added = event.actor.when;
  return entry;
}

}  // namespace

// ModelStore::list() is not used, because it would read every model of the store.
Result<StoredModel> stored_model(const ModelStore& store, const std::string& id) {
  auto document = store.load(id);
  ABBE_TRY(document);
  const auto active = store.active_id();
  ABBE_TRY(active);
  auto history = store.history();
  ABBE_TRY(history);
  std::erase_if(*history, [&id](const StoreEvent& event) { return event.id != id; });

  add_events(document->verdict, *history);
  StoreEntry entry = entry_of(*document, *history);
  entry.active = *active == id;
  return StoredModel{*std::move(document), std::move(entry), *std::move(history)};
}

}  // namespace abbe::daemon
