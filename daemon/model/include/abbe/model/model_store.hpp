#pragma once
/// Stores all models of the machine, accepted or refused, and which of them is active. A folder:
///
///   models/ID.json   one model.json each, never changed after it was written
///   state.json       all events in order (added, activated, rolled back), replaced as a whole
///   index.sqlite what lists need of each model.json; rebuilt if it is missing or damaged
///
/// A write creates a temporary file, syncs it to the disk and renames it: after a power failure the
/// store has either the old or the new state. Several processes may use a store; a lock file orders
/// their changes. Only processes that may write to the folder can open the lock file. A change
/// fails if it does not get the lock within kLockTimeout. An object must be used by one thread
/// only. A model file that cannot be read is listed with its fault; all other models remain usable.
/// Only regular files are read: a pipe or a device is a fault and is not waited for.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// Drifted: a run found that the machine has changed since the model, which was active. Removed:
/// the file of the model was removed because the store keeps a limited number of models.
enum class StoreAction { Added, Activated, Forced, RolledBack, Drifted, Removed };

struct StoreEvent {
  StoreAction action = StoreAction::Added;
  std::string id;  ///< the added or removed model, or the new active model
  StoreActor actor;
  bool accepted = false;             ///< Added: verdict of the gate
  std::vector<std::string> reasons;  ///< Added: reasons of a refusal
  /// Activated, Forced: machine_hash() of the configuration for which the actor accepted a model of
  /// an earlier version (ConfigurationFit::OlderHash); empty: none was accepted.
  std::string accepted_configuration{};
  bool operator==(const StoreEvent&) const = default;
};

struct StoreEntry {
  std::string id;
  bool active = false;
  /// False if neither the store nor the file has a verdict.
  bool judged = false;
  /// verdict of the gate when the model was added, else the verdict in the file
  bool accepted = false;
  std::vector<std::string> reasons;
  protocol::UtcTime added{};
  std::string method, machine;      ///< empty if the file cannot be read
  std::vector<std::string> inputs;  ///< names of the files from which the model was made
  std::string fault;                ///< reason why the file cannot be read; empty: readable
  std::optional<bool> simulated{};  ///< made_on_simulated_devices()
};

/// Identifies a version of state.json or of a model, which are always replaced, never modified. All
/// zero: the file does not exist.
struct StoreStamp {
  std::uint64_t inode = 0;
  std::int64_t modified_ns = 0;
  std::int64_t bytes = 0;
  bool operator==(const StoreStamp&) const = default;
};

class ModelStore {
 public:
  /// Opens a store; creates the folder if it does not exist. Io if that fails; BadInput if
  /// state.json is damaged (the models are not changed).
  [[nodiscard]] static Result<ModelStore> open(const std::filesystem::path& folder);

  /// Does not access the disk. For abbed, which also runs while the store is not available.
  explicit ModelStore(std::filesystem::path folder);
  /// Creates the folder if it does not exist.
  [[nodiscard]] Result<void> create() const;

  static constexpr std::chrono::seconds kLockTimeout{5};  ///< a change takes milliseconds
  /// Sets a shorter time-out than kLockTimeout.
  void set_lock_timeout(std::chrono::nanoseconds time_out) noexcept { lock_patience_ = time_out; }

  /// Renames a state.json that is damaged or not a regular file to state.json.damaged-DATE. After
  /// that no model is active and the stored models have the verdict of their files. Takes the lock
  /// of the store.
  [[nodiscard]] Result<void> rename_damaged_state(protocol::UtcTime now);
  /// The newest file name of the form state.json.damaged-DATE; empty: there is none.
  [[nodiscard]] std::string damaged_state() const;
  /// Removes temporary files (NAME.PID.new) of processes that no longer exist; failures are
  /// ignored. Call it at the start of the process, before the first write, because files with the
  /// own PID are also removed: they were left by an earlier process with the same PID.
  void remove_leftovers() const;

  /// Stores a model with the verdict of the gate, which is written into its file if it has none;
  /// returns its id. If a model with this id and verdict exists already, only the Added event is
  /// stored, unless the last Added event of this model is equal (verdict, reasons and actor).
  [[nodiscard]] Result<std::string> add(const ModelDocument& document, bool accepted,
                                        std::vector<std::string> reasons, const StoreActor& actor);

  /// Makes a model active. Refused if the gate did not accept the model, unless `force`; an Error
  /// if the model file is missing or damaged. The verdict is that of the store, or that of the file
  /// if the state of the store was lost. `accepted_configuration`: see StoreEvent.
  [[nodiscard]] Result<void> activate(const std::string& id, const StoreActor& actor,
                                      bool force = false, std::string accepted_configuration = {});

  /// Records that a run found drift against model `id`; `actor.why` states what changed. No effect
  /// if another model is active, or if the same event is recorded already.
  [[nodiscard]] Result<void> add_drift(const std::string& id, const StoreActor& actor);

  /// Activates the model that was active before `active`; returns its id. Refused if a model other
  /// than `active` is active: if a client repeats a request because the answer was lost, the
  /// repetition must not go back by another model. Refused if no model was active before.
  [[nodiscard]] Result<std::string> rollback(const StoreActor& actor, const std::string& active);

  /// Removes the models that `retention` does not keep; returns their ids, oldest first. The active
  /// model and those that a roll-back can activate are kept. The events are kept for all models.
  [[nodiscard]] Result<std::vector<std::string>> remove_old(const ModelRetention& retention,
                                                            const StoreActor& actor);

  [[nodiscard]] Result<std::vector<StoreEntry>> list() const;     ///< added last first
  [[nodiscard]] Result<std::vector<StoreEvent>> history() const;  ///< oldest first
  /// The id of the active model; nullopt if no model is active. Reads state.json at every call,
  /// because other processes may change it.
  [[nodiscard]] Result<std::optional<std::string>> active_id() const;
  /// The event that made the active model active; `accepted` and `reasons` are the verdict of the
  /// gate on that model, `accepted_configuration` the last one that the store has for it. Reads
  /// state.json at every call. nullopt: no model is active.
  [[nodiscard]] Result<std::optional<StoreEvent>> activation() const;
  /// The tables that have drifted since the last activation, as add_drift() recorded them last;
  /// empty: none.
  [[nodiscard]] Result<std::string> drift() const;
  [[nodiscard]] Result<ModelDocument> load(const std::string& id) const;
  /// True if the file of model `id` has exactly the bytes of to_json(document): load() would then
  /// give an equal document.
  [[nodiscard]] bool holds(const std::string& id, const ModelDocument& document) const;

  /// Identifies the present state.json. While the stamp is unchanged, nothing was added or
  /// activated.
  [[nodiscard]] StoreStamp stamp() const noexcept;

  /// The id that begins with `prefix` (at least 4 digits); for "active" the active id. Usage if no
  /// id or several ids match, or if `prefix` is shorter; the details list the ids that match.
  [[nodiscard]] Result<std::string> find(const std::string& prefix) const;
  [[nodiscard]] std::filesystem::path model_path(const std::string& id) const;

 private:
  std::filesystem::path folder_;
  std::filesystem::path state_file_;
  std::chrono::nanoseconds lock_patience_ = kLockTimeout;
};

}  // namespace abbe::daemon
