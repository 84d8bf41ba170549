#pragma once
/// The identity of a machine beside its name: a UUID that is made at the first start and kept in
/// DATA_DIR/identity.json. Two machines may have the same name by mistake (a copied configuration);
/// subscribers pin the identity.
///
/// A copied data folder would give two machines one identity. So the file also holds marks of the
/// computer on which it was made or confirmed: hashes of /etc/machine-id and of the permanent
/// addresses of its network cards, because a cloned disk has the same /etc/machine-id. On another
/// computer the identity is not confirmed, and no model becomes ACTIVE, before a person has decided:
/// this is the same machine with another computer ("keep"), or another machine ("new"). A computer
/// without both marks, such as a container, is not recognised, and changes nothing.
///
/// Functions access the disk and wait for it.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
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

/// A decision on the identity. Kept permanently.
struct IdentityEvent {
  IdentityAction action = IdentityAction::Made;
  std::string machine_id;  ///< since then
  std::string who, why;
  protocol::UtcTime when{};
  bool operator==(const IdentityEvent&) const = default;
};

struct MachineIdentity {
  std::string machine_id;  ///< UUID, 36 characters
  ComputerMarks computer;
  std::vector<IdentityEvent> events;  ///< in order; the first is Made

  /// When a person decided that this is another machine than the one of the data folder: models
  /// that were activated before are those of the other machine. nullopt: never.
  [[nodiscard]] std::optional<protocol::UtcTime> renewed() const;
  /// The machine_id at `time`; before the first start that made one, the first.
  [[nodiscard]] std::string machine_id_at(protocol::UtcTime time) const;
};

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
