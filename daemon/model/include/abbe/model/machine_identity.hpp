#pragma once
/// The identity of a machine in addition to its name: a UUID that is made at the first start and
/// kept in DATA_DIR/identity.json. Two machines may have the same name by mistake (a copied
/// configuration); subscribers therefore store the identity of their machine and compare it.
///
/// Two machines would get the same identity if a data folder were copied. Therefore the file also
/// contains marks of the computer on which the identity was made or confirmed: hashes of
/// /etc/machine-id and of the permanent addresses of its network cards. (A cloned disk has the same
/// /etc/machine-id.) On another computer the identity is not confirmed, and no model becomes
/// ACTIVE, until a person decides: this is the same machine with another computer ("keep"), or
/// another machine ("new"). A computer without both marks, such as a container, is not recognised;
/// the identity then stays confirmed.
///
/// The functions access the disk and wait for it.

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// Marks that distinguish computers. They are hashes, so that the file does not disclose the
/// original values.
struct ComputerMarks {
  std::string machine_id;               ///< hash of /etc/machine-id; empty: there is none
  std::vector<std::string> interfaces;  ///< hashes of the addresses of built-in network cards
  bool operator==(const ComputerMarks&) const = default;
};

/// `root`: folder that contains /etc and /sys.
[[nodiscard]] ComputerMarks marks_of_this_computer(const std::filesystem::path& root = "/");

/// False if the marks show two different computers: another /etc/machine-id, or no network card in
/// common. Marks that only one of them has are not compared. Pure.
[[nodiscard]] bool same_computer(const ComputerMarks& a, const ComputerMarks& b) noexcept;

enum class IdentityAction { Made, Kept, Renewed };

/// A place in the list of events of the model store. Dates are not used to order events, because
/// the clock of the computer may be wrong or may have been set.
struct StorePlace {
  std::size_t events = 0;  ///< number of events before the place
  std::string last;        ///< id and date of the last of these events; empty: there is none
  bool operator==(const StorePlace&) const = default;
};
[[nodiscard]] StorePlace end_of(std::span<const StoreEvent> history);

/// A decision on the identity. Kept permanently.
struct IdentityEvent {
  IdentityAction action = IdentityAction::Made;
  std::string machine_id;  ///< the machine_id from this event on
  std::string who, why;
  protocol::UtcTime when{};
  /// For Kept and Renewed: the end of the store's list of events at that time; nullopt: the store
  /// could not be read.
  std::optional<StorePlace> store{};
  bool operator==(const IdentityEvent&) const = default;
};

struct MachineIdentity {
  std::string machine_id;  ///< UUID, 36 characters
  ComputerMarks computer;
  std::vector<IdentityEvent> events;  ///< events in order; the first is Made

  /// The last event in which a person decided that this machine is not the machine from which the
  /// data folder comes. Null: there is none.
  [[nodiscard]] const IdentityEvent* renewal() const noexcept;
  /// The machine_id at `time`; for a time before the first start, the first machine_id.
  [[nodiscard]] std::string machine_id_at(protocol::UtcTime time) const;
};

/// The ids, sorted, of models that belong to the machine from which the data folder was copied:
/// neither a person nor the gate has activated them after the renewal. A roll-back does not count
/// as an activation. `history`: all events of the store. If the store was made again since the
/// renewal, its events are compared by their dates.
[[nodiscard]] std::vector<std::string> models_of_other_machine(const MachineIdentity& identity,
                                                               std::span<const StoreEvent> history);
/// The machine_id at the time when model `id` was added to the store; nullopt: the store has no
/// such event.
[[nodiscard]] std::optional<std::string> machine_id_of_model(const MachineIdentity& identity,
                                                             std::span<const StoreEvent> history,
                                                             const std::string& id);

[[nodiscard]] std::filesystem::path identity_file(const std::filesystem::path& data_dir);

/// Reads the identity. nullopt: there is no file. BadInput: it is damaged. Io: it cannot be read.
[[nodiscard]] Result<std::optional<MachineIdentity>> read_identity(
    const std::filesystem::path& data_dir);

/// Reads the identity, or creates it if there is none. The errors are those of read_identity(), or
/// Io if the file cannot be written.
[[nodiscard]] Result<MachineIdentity> open_identity(const std::filesystem::path& data_dir,
                                                    const ComputerMarks& here,
                                                    protocol::UtcTime now);

/// The reason why the identity may not be used before a person decides; empty: it may be used.
/// Pure.
[[nodiscard]] std::string why_not_confirmed(const MachineIdentity& identity,
                                            const ComputerMarks& here);

/// Reason why a model may not be used that was not activated after the renewal.
inline constexpr const char* kOfOtherMachine =
    "the model is of the machine from which the data folder was copied: calibrate, or check it and "
    "run `abbe model activate` with a reason";

/// The identity of the machine of `store`, which is DATA_DIR/models. As read_identity().
[[nodiscard]] Result<std::optional<MachineIdentity>> identity_of(const ModelStore& store);
/// The reason why, given the identity, model `id` may not be used. Empty: there is none, or there
/// is no identity.
[[nodiscard]] std::string identity_doubt(const ModelStore& store, const std::string& id,
                                         const ComputerMarks& here);

struct IdentityDecision {
  IdentityAction action = IdentityAction::Kept;  ///< Kept or Renewed
  std::string who, why;
  protocol::UtcTime when{};
};

/// Records the decision of a person and binds the identity to this computer. If the file is damaged
/// or missing, the identity can only be renewed; Kept is Refused.
[[nodiscard]] Result<MachineIdentity> decide_identity(const std::filesystem::path& data_dir,
                                                      const ComputerMarks& here,
                                                      const IdentityDecision& decision);

}  // namespace abbe::daemon
