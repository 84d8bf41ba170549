#pragma once
/// The identity of a machine beside its name: a UUID that is made at the first start and kept in
/// DATA_DIR/identity.json. Two machines may have the same name by mistake (a copied configuration);
/// subscribers pin the identity.
///
/// A copied data folder would give two machines one identity. So the file also holds marks of the
/// computer on which it was made or confirmed: hashes of /etc/machine-id and of the permanent
/// addresses of its network cards, because a cloned disk has the same /etc/machine-id. On another
/// computer the identity is not confirmed, and no model becomes ACTIVE, before a person has
/// decided:
/// this is the same machine with another computer ("keep"), or another machine ("new"). A computer
/// without both marks, such as a container, is not recognised, and changes nothing.
///
/// Functions access the disk and wait for it.

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// What tells one computer from another. Hashes, so that the file does not disclose the originals.
struct ComputerMarks {
  std::string machine_id;               ///< of /etc/machine-id; empty: there is none
  std::vector<std::string> interfaces;  ///< of the addresses of built-in network cards
  bool operator==(const ComputerMarks&) const = default;
};

/// `root`: where /etc and /sys are.
[[nodiscard]] ComputerMarks marks_of_this_computer(const std::filesystem::path& root = "/");

/// False if the marks that both have are of different computers: another /etc/machine-id, or no
/// network card in common. Pure.
[[nodiscard]] bool same_computer(const ComputerMarks& a, const ComputerMarks& b) noexcept;

enum class IdentityAction { Made, Kept, Renewed };

/// A place in the events of the model store. A date does not order events: the clock of the
/// computer may be wrong, or set.
struct StorePlace {
  std::size_t events = 0;  ///< number of events before the place
  std::string last;        ///< the last of them, id and date; empty: there is none
  bool operator==(const StorePlace&) const = default;
};
[[nodiscard]] StorePlace end_of(std::span<const StoreEvent> history);

/// A decision on the identity. Kept permanently.
struct IdentityEvent {
  IdentityAction action = IdentityAction::Made;
  std::string machine_id;  ///< since then
  std::string who, why;
  protocol::UtcTime when{};
  /// Kept, Renewed: the end of the store at that time; nullopt: it could not be read.
  std::optional<StorePlace> store{};
  bool operator==(const IdentityEvent&) const = default;
};

struct MachineIdentity {
  std::string machine_id;  ///< UUID, 36 characters
  ComputerMarks computer;
  std::vector<IdentityEvent> events;  ///< in order; the first is Made

  /// The last decision of a person that this is another machine than the one of the data folder.
  /// Null: there is none.
  [[nodiscard]] const IdentityEvent* renewal() const noexcept;
  /// The machine_id at `time`; before the first start that made one, the first.
  [[nodiscard]] std::string machine_id_at(protocol::UtcTime time) const;
};

/// The models that neither a person nor the gate activated after the renewal, sorted: they are of
/// the machine from which the data folder was copied. A roll-back accepts no model. `history`: all
/// events of the store. Where these are not those of the renewal (the store was made again), dates
/// decide.
[[nodiscard]] std::vector<std::string> models_of_other_machine(const MachineIdentity& identity,
                                                               std::span<const StoreEvent> history);
/// The machine_id when model `id` was added to the store; nullopt: the store has no such event.
[[nodiscard]] std::optional<std::string> machine_id_of_model(const MachineIdentity& identity,
                                                             std::span<const StoreEvent> history,
                                                             const std::string& id);

[[nodiscard]] std::filesystem::path identity_file(const std::filesystem::path& data_dir);

/// nullopt: there is no file. BadInput: it is damaged. Io: it cannot be read.
[[nodiscard]] Result<std::optional<MachineIdentity>> read_identity(
    const std::filesystem::path& data_dir);

/// Reads the identity, or makes it. The errors are those of read_identity(), or Io if the file
/// cannot be written.
[[nodiscard]] Result<MachineIdentity> open_identity(const std::filesystem::path& data_dir,
                                                    const ComputerMarks& here,
                                                    protocol::UtcTime now);

/// Why the identity may not be used without a decision; empty: it may. Pure.
[[nodiscard]] std::string why_not_confirmed(const MachineIdentity& identity,
                                            const ComputerMarks& here);

/// Why a model that was not activated after the renewal may not be used.
inline constexpr const char* kOfOtherMachine =
    "the model is of the machine from which the data folder was copied: calibrate, or check it and "
    "run `abbe model activate` with a reason";

/// The identity of the machine of `store`, which is DATA_DIR/models. As read_identity().
[[nodiscard]] Result<std::optional<MachineIdentity>> identity_of(const ModelStore& store);
/// What the identity has against the use of model `id`; empty: nothing, or there is no identity.
[[nodiscard]] std::string identity_doubt(const ModelStore& store, const std::string& id,
                                         const ComputerMarks& here);

struct IdentityDecision {
  IdentityAction action = IdentityAction::Kept;  ///< Kept or Renewed
  std::string who, why;
  protocol::UtcTime when{};
};

/// Records the decision of a person, and binds the identity to this computer. A damaged or missing
/// file can only be renewed: Refused.
[[nodiscard]] Result<MachineIdentity> decide_identity(const std::filesystem::path& data_dir,
                                                      const ComputerMarks& here,
                                                      const IdentityDecision& decision);

}  // namespace abbe::daemon
