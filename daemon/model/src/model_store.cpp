#include "abbe/model/model_store.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <map>
#include <utility>

#include "abbe/base/text_file.hpp"
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
  if (!text) return tl::make_unexpected(text.error());
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

/// The ids on disk, and those of all Added events: models are never removed, so an added model
/// without a file is lost and must be listed.
Result<std::vector<std::string>> ids_in_store(const fs::path& folder, const StoreState& state) {
  auto ids = ids_on_disk(folder);
  if (!ids) return ids;
  for (const auto& event : state.events)
    if (event.action == StoreAction::Added) ids->push_back(event.id);
  std::sort(ids->begin(), ids->end());
  ids->erase(std::unique(ids->begin(), ids->end()), ids->end());
  return ids;
}

/// From 1: place of the last Added event of each model.
std::map<std::string, std::size_t> order_of_adding(const StoreState& state) {
  std::map<std::string, std::size_t> order;
  for (std::size_t i = 0; i < state.events.size(); ++i)
    if (state.events[i].action == StoreAction::Added) order[state.events[i].id] = i + 1;
  return order;
}

/// That of the state; where it was lost, that of the file.
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

/// Notes may differ.
bool same_decision(const std::optional<ModelVerdict>& a, const ModelVerdict& b) {
  return a && a->accepted == b.accepted && a->reasons == b.reasons;
}

/// model.json of the document with its own verdict, or with `verdict` if it has another one.
std::string judged_text(const ModelDocument& document, const ModelVerdict& verdict) {
  if (same_decision(document.verdict, verdict)) return to_json(document);
  ModelDocument judged = document;
  judged.verdict = verdict;
  return to_json(judged);
}

constexpr std::size_t kShortestPrefix = 4;

/// Why `prefix` does not name one of `candidates`, the ids that begin with it.
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
  if (const auto made = store.create(); !made) return tl::make_unexpected(made.error());
  if (const auto state = read_state(folder); !state) return tl::make_unexpected(state.error());
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
  // but with the same model, because the id is a hash of the model. A file of this id that is
  // damaged, or has another verdict, is replaced.
  const ModelVerdict verdict{accepted, reasons};
  if (const auto known = load(id); !known || !same_decision(known->verdict, verdict))
    if (const auto written = replace_file(model_path(id), judged_text(document, verdict)); !written)
      return tl::make_unexpected(written.error());
  const auto lock = lock_store(folder_, lock_patience_);
  if (!lock) return tl::make_unexpected(lock.error());
  auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());

  StoreEvent event{StoreAction::Added, id, actor, accepted, std::move(reasons)};

  // An equal last event means that the caller repeats a change whose last step failed, for example
  // the fsync of the folder: it is not added twice.
  if (const auto* last = state->last_added(id); last != nullptr && *last == event) return id;
  if (const auto done = append(folder_, std::move(*state), std::move(event)); !done)
    return tl::make_unexpected(done.error());

  return id;
}

Result<void> ModelStore::activate(const std::string& id, const StoreActor& actor, bool force,
                                  std::string accepted_configuration) {
  const auto lock = lock_store(folder_, lock_patience_);
  if (!lock) return tl::make_unexpected(lock.error());
  auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  const auto document = load(id);
  if (!document) return tl::make_unexpected(document.error());
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
  if (!lock) return tl::make_unexpected(lock.error());
  auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  StoreEvent event{StoreAction::Drifted, id, actor, false, {}};
  const bool known =
      std::find(state->events.begin(), state->events.end(), event) != state->events.end();
  if (known || state->active() != id) return {};

  return append(folder_, std::move(*state), std::move(event));
}

Result<std::string> ModelStore::rollback(const StoreActor& actor, const std::string& active) {
  const auto lock = lock_store(folder_, lock_patience_);
  if (!lock) return tl::make_unexpected(lock.error());
  auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  if (const auto present = state->active(); present != active)
    return fail(ErrorCode::Refused,
                fmt::format("roll back: model {} is not active ({} is): nothing was changed; look "
                            "whether the roll-back has taken place already",
                            active, present ? "model " + *present : "none"));
  const auto stack = state->activations();
  if (stack.size() < 2)
    return fail(ErrorCode::Refused, "roll back: no model was active before the present one");
  const auto& id = stack[stack.size() - 2];
  if (const auto document = load(id); !document) return tl::make_unexpected(document.error());
  if (const auto done = append(folder_, std::move(*state),
                               StoreEvent{StoreAction::RolledBack, id, actor, false, {}});
      !done)
    return tl::make_unexpected(done.error());

  return id;
}

Result<std::vector<StoreEntry>> ModelStore::list() const {
  const auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  const auto active = state->active();
  const auto ids = ids_in_store(folder_, *state);
  if (!ids) return tl::make_unexpected(ids.error());
  std::vector<StoreEntry> entries;

  for (const auto& id : *ids) {
    StoreEntry entry;
    entry.id = id;
    entry.active = active == id;
    const StoreEvent* added = state->last_added(id);
    if (added != nullptr) {
      set_verdict(entry, ModelVerdict{added->accepted, added->reasons});
      entry.added = added->actor.when;
    }
    if (const auto document = load(id)) {
      entry.method = document->method;
      entry.machine = document->machine;
      entry.simulated = made_on_simulated_devices(*document);
      if (added == nullptr) set_verdict(entry, document->verdict);
    } else {
      entry.fault = document.error().text;
    }
    entries.push_back(std::move(entry));
  }

  // In the order of the events, not of their dates: the clock may have been set back in between.
  const auto order = order_of_adding(*state);
  const auto rank = [&order](const StoreEntry& entry) {
    const auto found = order.find(entry.id);
    return found == order.end() ? 0 : found->second;
  };
  std::stable_sort(entries.begin(), entries.end(),
                   [&rank](const auto& a, const auto& b) { return rank(a) > rank(b); });
  return entries;
}

Result<std::vector<StoreEvent>> ModelStore::history() const {
  auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  return std::move(state->events);
}

Result<std::optional<std::string>> ModelStore::active_id() const {
  const auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  return state->active();
}

Result<std::optional<StoreEvent>> ModelStore::activation() const {
  const auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  return state->activation();
}

StoreStamp ModelStore::stamp() const noexcept {
  struct stat status {};
  if (::stat(state_file_.c_str(), &status) != 0) return {};
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  return {status.st_ino, status.st_mtim.tv_sec * kSecond_ns + status.st_mtim.tv_nsec,
          status.st_size};
}

Result<std::string> ModelStore::drift() const {
  const auto state = read_state(folder_);
  if (!state) return tl::make_unexpected(state.error());
  return state->drift();
}

Result<ModelDocument> ModelStore::load(const std::string& id) const {
  const auto file = model_path(id);
  const auto text = read_regular_file(file);
  if (!text) return tl::make_unexpected(text.error());
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
    if (!active) return tl::make_unexpected(active.error());
    return *active ? Result<std::string>{**active} : fail(ErrorCode::Usage, "no model is active");
  }

  const auto ids = ids_on_disk(folder_);
  if (!ids) return tl::make_unexpected(ids.error());
  std::vector<std::string> found;
  for (const auto& id : *ids)
    if (id.starts_with(prefix)) found.push_back(id);

  if (found.size() == 1 && prefix.size() >= kShortestPrefix) return found.front();
  return tl::make_unexpected(not_found(prefix, found, folder_));
}

}  // namespace abbe::daemon
