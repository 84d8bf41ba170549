#pragma once
/// All models the machine ever had, accepted or refused, and which of them is active. A folder:
///     models/ID.json   one model.json each, never changed once written
///     state.json       every event in order (added, activated, rolled back), replaced as a whole
/// Each write goes to a new file, to the disk, then over the old name: after a power cut the old or the new
/// state is there, never half of one. Several processes may use a store (a lock file orders them, which only
/// who may write to the folder can open; a change that gets no lock for kLockPatience fails); one object
/// belongs to one thread. A model file that cannot be read is listed with its fault and stands in nobody's
/// way. Only regular files are read: a pipe or device laid there is a fault, not a wait.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// Who asked for a change, why, and when: kept for ever.
struct StoreActor {
  std::string who;
  std::string why;
  protocol::UtcTime when{};
  bool operator==(const StoreActor&) const = default;
};

enum class StoreAction { Added, Activated, Forced, RolledBack };

struct StoreEvent {
  StoreAction action = StoreAction::Added;
  std::string id;  ///< the model added, or the one that is active from now on
  StoreActor actor;
  bool accepted = false;             ///< Added: what the gate said
  std::vector<std::string> reasons;  ///< Added: why it was refused
  bool operator==(const StoreEvent&) const = default;
};

struct StoreEntry {
  std::string id;
  bool active = false;
  bool accepted = false;  ///< by the gate, when it was added
  std::vector<std::string> reasons;
  protocol::UtcTime added{};
  std::string method, machine;  ///< empty if the file cannot be read
  std::string fault;            ///< why the file cannot be read; empty if it can
};

/// Which state.json this is: it is replaced, never written to. All zero: there is none.
struct StoreStamp {
  std::uint64_t inode = 0;
  std::int64_t modified_ns = 0;
  std::int64_t bytes = 0;
  bool operator==(const StoreStamp&) const = default;
};

class ModelStore {
 public:
  /// Creates the folder if needed. Io if that fails, BadInput if state.json is damaged (the models
  /// are left alone).
  [[nodiscard]] static Result<ModelStore> open(const std::filesystem::path& folder);

  /// The same without touching the disk: for who goes on without a store until there is one.
  explicit ModelStore(std::filesystem::path folder);
  /// The folder, if it is not there.
  [[nodiscard]] Result<void> create() const;

  static constexpr std::chrono::seconds kLockPatience{5};  ///< a change takes milliseconds
  /// For who has less time.
  void set_lock_patience(std::chrono::nanoseconds patience) noexcept { lock_patience_ = patience; }

  /// Renames a state.json that is no state (damaged, a pipe ...) to state.json.damaged-DATE. Which
  /// model was active is not known then, and the models that are there count as never judged. Not
  /// while another process changes the store.
  [[nodiscard]] Result<void> set_aside_damaged_state(protocol::UtcTime now);
  /// The newest name of such a file; empty: there is none.
  [[nodiscard]] std::string damaged_state() const;
  /// Removes what processes that are gone left of a write (NAME.PID.new). Best effort. At the start
  /// of a process, before it writes: what bears its own number is somebody else's.
  void remove_leftovers() const;

  /// Keeps a model with the gate's verdict; returns its id. A model that is there already (same id)
  /// is not written again, but the event is, unless it is the one before once more (same verdict
  /// and actor).
  [[nodiscard]] Result<std::string> add(const ModelDocument& document, bool accepted,
                                        std::vector<std::string> reasons, const StoreActor& actor);

  /// Makes a model active. Refused if the gate refused it, unless forced; BadInput if it is not
  /// there or damaged.
  [[nodiscard]] Result<void> activate(const std::string& id, const StoreActor& actor,
                                      bool force = false);

  /// Back to the model that was active before; returns its id. Refused if there was none.
  [[nodiscard]] Result<std::string> rollback(const StoreActor& actor);

  [[nodiscard]] Result<std::vector<StoreEntry>> list() const;     ///< newest first
  [[nodiscard]] Result<std::vector<StoreEvent>> history() const;  ///< oldest first
  [[nodiscard]] Result<std::optional<std::string>> active_id()
      const;  ///< read anew each time: others may change it
  /// What put the active model in force, read anew each time; `accepted`: what the gate said of the
  /// model. None: no model is active.
  [[nodiscard]] Result<std::optional<StoreEvent>> activation() const;
  [[nodiscard]] Result<ModelDocument> load(const std::string& id) const;

  /// The same as before: nothing was added or activated since.
  [[nodiscard]] StoreStamp stamp() const noexcept;

  /// The id that begins with `prefix` (4 digits at least), or "active". Usage if none or several
  /// do.
  [[nodiscard]] Result<std::string> find(const std::string& prefix) const;
  [[nodiscard]] std::filesystem::path model_path(const std::string& id) const;

 private:
  std::filesystem::path folder_;
  std::filesystem::path state_file_;
  std::chrono::nanoseconds lock_patience_ = kLockPatience;
};

}  // namespace abbe::daemon
