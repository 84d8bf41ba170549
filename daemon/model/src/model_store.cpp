#include "abbe/model/model_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "model_index.hpp"
#include "store_lock.hpp"
#include "store_state.hpp"

namespace abbe::daemon {

namespace {

namespace fs = std::filesystem;

fs::path state_path(const fs::path& folder) {
  return folder / "state.json";
}

/// A new store has no state.json and no events.
Result<StoreState> read_state(const fs::path& folder) {
  const auto file = state_path(folder);
  std::error_code seen;
  if (fs::status(file, seen).type() == fs::file_type::not_found) return StoreState{};
  const auto text = read_regular_file(file);
  ABBE_TRY(text);
  return store_state_from_text(*text, file.string());
}

Result<void> append(const fs::path& folder, StoreState state, StoreEvent event) {
  state.events.push_back(std::move(event));
  return replace_file(state_path(folder), to_text(state));
}

bool is_id(const std::string& text) {
  return text.size() == 16 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

/// The ids of the files in models/, in order of name.
Result<std::vector<std::string>> ids_on_disk(const fs::path& folder) {
  std::vector<std::string> ids;
  std::error_code error;
  for (fs::directory_iterator entry(folder / "models", error), end; !error && entry != end;
       entry.increment(error))
    if (entry->path().extension() == ".json" && is_id(entry->path().stem().string()))
      ids.push_back(entry->path().stem().string());
  if (error)
    return fail(ErrorCode::Io,
                fmt::format("list {}: {}", (folder / "models").string(), error.message()));
  std::sort(ids.begin(), ids.end());
  return ids;
}

/// The ids on disk, and the ids of all Added events: an added model whose file is missing is lost
/// and must be listed. Models that were removed are not included.
Result<std::vector<std::string>> ids_in_store(const fs::path& folder, const StoreState& state) {
  auto ids = ids_on_disk(folder);
  if (!ids) return ids;
  const auto models = state.models();
  for (const auto& [id, event] : models) ids->emplace_back(id);
  std::sort(ids->begin(), ids->end());
  ids->erase(std::unique(ids->begin(), ids->end()), ids->end());
  std::erase_if(*ids, [&models](const std::string& id) {
    const auto known = models.find(id);
    return known != models.end() && known->second->action == StoreAction::Removed;
  });
  return ids;
}

/// The verdict in the state, or the verdict in the file if the state was lost.
std::optional<ModelVerdict> verdict_on(const StoreState& state, const ModelDocument& document) {
  const StoreEvent* added = state.last_added(model_id(document));
  if (added == nullptr) return document.verdict;
  return ModelVerdict{added->accepted, added->reasons};
}

void set_verdict(StoreEntry& entry, const std::optional<ModelVerdict>& verdict) {
  entry.judged = verdict.has_value();
  if (!verdict) return;
  entry.accepted = verdict->accepted;
  entry.reasons = verdict->reasons;
}

/// True if decision and reasons are equal; notes may differ.
bool same_decision(const std::optional<ModelVerdict>& a, const ModelVerdict& b) {
  return a && a->accepted == b.accepted && a->reasons == b.reasons;
}

/// The document with its own verdict, or with `verdict` if the decisions differ.
ModelDocument with_verdict(ModelDocument document, const ModelVerdict& verdict) {
  if (!same_decision(document.verdict, verdict)) document.verdict = verdict;
  return document;
}

constexpr std::size_t kShortestPrefix = 4;

/// The Error that `prefix` does not name one model. `candidates`: the ids that begin with it.
Error not_found(const std::string& prefix, const std::vector<std::string>& candidates,
                const fs::path& folder) {
  constexpr std::size_t kMostListed = 10;
  Error error{ErrorCode::Usage, fmt::format("model \"{}\": ", prefix)};

  if (prefix.size() < kShortestPrefix)
    error.text += fmt::format("give at least {} characters of the id; ", kShortestPrefix);
  if (candidates.empty()) {
    error.text += fmt::format("no id in {} begins with it", folder.string());
    return error;
  }
  error.text += fmt::format("{} {} in {} {} with it", candidates.size(),
                            candidates.size() == 1 ? "id" : "ids", folder.string(),
                            candidates.size() == 1 ? "begins" : "begin");
  if (candidates.size() > 1 && prefix.size() >= kShortestPrefix)
    error.text += ": give more characters";

  for (const auto& id : candidates) {
    if (error.details.size() < kMostListed) error.details.push_back(id);
  }
  if (candidates.size() > kMostListed)
    error.details.push_back(fmt::format("and {} more", candidates.size() - kMostListed));
  return error;
}

}  // namespace

Result<ModelStore> ModelStore::open(const fs::path& folder) {
  ModelStore store{folder};
  ABBE_TRY(store.create());
  ABBE_TRY(read_state(folder));
  return store;
}

Result<void> ModelStore::create() const {
  return create_folder(folder_ / "models");
}

ModelStore::ModelStore(fs::path folder)
    : folder_(std::move(folder)), state_file_(state_path(folder_)) {}

fs::path ModelStore::model_path(const std::string& id) const {
  return folder_ / "models" / (id + ".json");
}

Result<std::string> ModelStore::add(const ModelDocument& document, bool accepted,
                                    std::vector<std::string> reasons, const StoreActor& actor) {
  const auto id = model_id(document);
  // The model file is written first and without the lock. Another process may write the same file,
  // but with the same model, because the id is a hash of the model. A file with this id is replaced
  // if it is damaged or has another verdict.
  const ModelVerdict verdict{accepted, reasons};
  const auto write_model_file = [&]() -> Result<void> {
    const ModelDocument judged = with_verdict(document, verdict);
    ABBE_TRY(replace_file(model_path(id), to_json(judged)));
    const IndexedModel indexed{id, stamp_of_file(model_path(id)), summary_of(judged)};
    ModelIndex{folder_}.put({&indexed, 1});
    return {};
  };
  if (const auto known = load(id); !known || !same_decision(known->verdict, verdict))
    ABBE_TRY(write_model_file());
  const auto lock = lock_store(folder_, lock_patience_);
  ABBE_TRY(lock);
  // remove_old() of another process may have deleted the file meanwhile.
  if (std::error_code seen; !fs::exists(model_path(id), seen) && !seen)
    ABBE_TRY(write_model_file());
  auto state = read_state(folder_);
  ABBE_TRY(state);

  StoreEvent event{StoreAction::Added, id, actor, accepted, std::move(reasons)};

  // An equal last event means that the caller repeats a change whose last step failed, for example
  // the fsync of the folder: it is not added twice.
  if (const auto* last = state->last_added(id); last != nullptr && *last == event) return id;
  ABBE_TRY(append(folder_, std::move(*state), std::move(event)));

  return id;
}

Result<void> ModelStore::activate(const std::string& id, const StoreActor& actor, bool force,
                                  std::string accepted_configuration) {
  const auto lock = lock_store(folder_, lock_patience_);
  ABBE_TRY(lock);
  auto state = read_state(folder_);
  ABBE_TRY(state);
  const auto document = load(id);
  ABBE_TRY(document);
  const auto verdict = verdict_on(*state, *document);
  const bool accepted = verdict && verdict->accepted;
  if (!accepted && !force)
    return fail(ErrorCode::Refused,
                verdict
                    ? fmt::format("activate {}: the gate refused it: {}", id,
                                  fmt::join(verdict->reasons, "; "))
                    : fmt::format("activate {}: it has no verdict of the gate (use force)", id));
  const auto action = accepted ? StoreAction::Activated : StoreAction::Forced;

  return append(folder_, std::move(*state),
                StoreEvent{action, id, actor, accepted, {}, std::move(accepted_configuration)});
}

Result<void> ModelStore::add_drift(const std::string& id, const StoreActor& actor) {
  const auto lock = lock_store(folder_, lock_patience_);
  ABBE_TRY(lock);
  auto state = read_state(folder_);
  ABBE_TRY(state);
  StoreEvent event{StoreAction::Drifted, id, actor, false, {}};
  const bool known =
      std::find(state->events.begin(), state->events.end(), event) != state->events.end();
  if (known || state->active() != id) return {};

  return append(folder_, std::move(*state), std::move(event));
}

Result<std::string> ModelStore::rollback(const StoreActor& actor, const std::string& active) {
  const auto lock = lock_store(folder_, lock_patience_);
  ABBE_TRY(lock);
  auto state = read_state(folder_);
  ABBE_TRY(state);
  if (const auto present = state->active(); present != active)
    return fail(ErrorCode::Refused,
                fmt::format("roll back: model {} is not active ({} is): nothing was changed; look "
                            "whether the roll-back has taken place already",
                            active, present ? "model " + *present : "none"));
  const auto stack = state->activations();
  if (stack.size() < 2)
    return fail(ErrorCode::Refused, "roll back: no model was active before the present one");
  const auto& id = stack[stack.size() - 2];
  ABBE_TRY(load(id));
  ABBE_TRY(append(folder_, std::move(*state),
                  StoreEvent{StoreAction::RolledBack, id, actor, false, {}}));

  return id;
}

Result<std::vector<std::string>> ModelStore::remove_old(const ModelRetention& retention,
                                                        const StoreActor& actor) {
  if (retention.keep_newest == 0) return std::vector<std::string>{};
  const auto lock = lock_store(folder_, lock_patience_);
  ABBE_TRY(lock);
  auto state = read_state(folder_);
  ABBE_TRY(state);

  const auto removed = state->beyond(retention, actor.when);
  for (const auto& id : removed)
    state->events.push_back(StoreEvent{StoreAction::Removed, id, actor, false, {}});
  if (!removed.empty()) ABBE_TRY(replace_file(state_file_, to_text(*state)));

  // Also tries again to remove files that an earlier call could not remove.
  for (const auto& [id, event] : state->models()) {
    std::error_code error;
    if (event->action != StoreAction::Removed) continue;
    if (!fs::remove(model_path(std::string{id}), error) && error)
      return fail(ErrorCode::Io, fmt::format("remove {}: {}", model_path(std::string{id}).string(),
                                             error.message()));
  }
  return removed;
}

Result<std::vector<StoreEntry>> ModelStore::list() const {
  const auto state = read_state(folder_);
  ABBE_TRY(state);
  const auto active = state->active();
  const auto ids = ids_in_store(folder_, *state);
  ABBE_TRY(ids);
  auto found = summaries(*this, folder_, *ids);
  const auto models = state->models();
  std::vector<StoreEntry> entries;

  for (std::size_t i = 0; i < ids->size(); ++i) {
    StoreEntry entry{.id = (*ids)[i]};
    entry.active = active == entry.id;
    if (const auto added = models.find(entry.id); added != models.end()) {
      set_verdict(entry, ModelVerdict{added->second->accepted, added->second->reasons});
      entry.added = added->second->actor.when;
    } else {
      set_verdict(entry, found[i].verdict);
    }
    entry.method = std::move(found[i].method);
    entry.machine = std::move(found[i].machine);
    entry.inputs = std::move(found[i].inputs);
    entry.fault = std::move(found[i].fault);
    entry.simulated = found[i].simulated;
    entries.push_back(std::move(entry));
  }

  // Entries are sorted by the order of the events, not by their dates, because the clock may have
  // been set back in between.
  std::ranges::stable_sort(entries, std::greater<>{}, [&models](const StoreEntry& entry) {
    const auto added = models.find(entry.id);
    return added == models.end() ? nullptr : added->second;
  });
  return entries;
}

Result<std::vector<StoreEvent>> ModelStore::history() const {
  auto state = read_state(folder_);
  ABBE_TRY(state);
  return std::move(state->events);
}

Result<std::optional<std::string>> ModelStore::active_id() const {
  const auto state = read_state(folder_);
  ABBE_TRY(state);
  return state->active();
}

Result<std::optional<StoreEvent>> ModelStore::activation() const {
  const auto state = read_state(folder_);
  ABBE_TRY(state);
  return state->activation();
}

StoreStamp ModelStore::stamp() const noexcept {
  return stamp_of_file(state_file_);
}

Result<std::string> ModelStore::drift() const {
  const auto state = read_state(folder_);
  ABBE_TRY(state);
  return state->drift();
}

Result<ModelDocument> ModelStore::load(const std::string& id) const {
  const auto file = model_path(id);
  const auto text = read_regular_file(file);
  ABBE_TRY(text);
  auto document = parse_model(*text, file.string());
  if (document && model_id(*document) != id)
    return fail(
        ErrorCode::BadInput,
        fmt::format("{}: the id of the model differs from the file name", model_path(id).string()));
  return document;
}

bool ModelStore::holds(const std::string& id, const ModelDocument& document) const {
  const auto text = read_regular_file(model_path(id));
  return text && *text == to_json(document);
}

Result<std::string> ModelStore::find(const std::string& prefix) const {
  if (prefix == "active") {
    const auto active = active_id();
    ABBE_TRY(active);
    return *active ? Result<std::string>{**active} : fail(ErrorCode::Usage, "no model is active");
  }

  const auto ids = ids_on_disk(folder_);
  ABBE_TRY(ids);
  std::vector<std::string> found;
  for (const auto& id : *ids)
    if (id.starts_with(prefix)) found.push_back(id);

  if (found.size() == 1 && prefix.size() >= kShortestPrefix) return found.front();
  return tl::make_unexpected(not_found(prefix, found, folder_));
}

}  // namespace abbe::daemon
