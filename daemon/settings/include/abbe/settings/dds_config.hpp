#pragma once
/// The table [dds] of the configuration. abbed reads it as part of the configuration; abbe-dds and
/// abbe-watch read only this table.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/settings/section.hpp"

namespace abbe::daemon {

/// Default of [daemon] runtime_dir.
inline constexpr const char* kRuntimeFolder = "/run/abbe";

/// The program that starts abbe-dds. ByStart: systemd if abbed runs as abbed.service, else abbed
/// itself; use_dds_unit() decides this.
enum class Supervise { ByStart, Child, Systemd, Off };

/// Table [dds].
struct DdsConfig {
  std::uint32_t domain = 0;
  double snapshot_hz = 50.0;       ///< maximum rate; 0: with every hub cycle that has new data
  double compensation_hz = 100.0;  ///< maximum rate; 0: with every hub cycle that has new data
  /// A subscriber must not apply a compensation vector older than this.
  std::chrono::nanoseconds validity{std::chrono::milliseconds{500}};
  Supervise supervise = Supervise::ByStart;
  /// Used with Systemd only: the user as which abbe-dds runs; only this user may connect. Empty:
  /// the user of abbed.
  std::string user = "abbe-dds";
  int priority = 20;  ///< SCHED_FIFO priority of abbe-dds, below hub and devices; 0: not SCHED_FIFO
  std::filesystem::path profile;  ///< XML profiles; empty: the built-in ones
  /// Folder of keys made by `abbe dds keys`; empty: the profile determines the security.
  std::filesystem::path security;
  /// Default: runtime_dir/dds.sock; with Systemd dds.sock in the folder "RUNTIME_DIR-dds", which
  /// abbe-dds may enter.
  std::filesystem::path socket;
};

/// Reads the table; the caller reports unknown keys. `base`: folder of the file, for relative
/// paths; `runtime_dir`: [daemon] runtime_dir.
void read_dds(Section&, const std::filesystem::path& base, const std::filesystem::path& runtime_dir,
              DdsConfig& out);

/// Sets [dds] supervise if the configuration does not set it, and the default socket that depends
/// on it. `unit`: abbed runs as abbed.service, beside abbe-dds.service.
void use_dds_unit(DdsConfig&, const std::filesystem::path& runtime_dir, bool unit);

/// The part of the configuration that a process other than abbed needs.
struct ParticipantConfig {
  std::filesystem::path runtime_dir = kRuntimeFolder;
  DdsConfig dds;
};
/// Reads [dds] and [daemon] runtime_dir. Other tables are not checked: abbed does that. Io if the
/// file cannot be read, BadInput with the faults in the form of load_config().
[[nodiscard]] Result<ParticipantConfig> load_participant_config(const std::filesystem::path& file);
/// `file`: used for relative paths and in messages.
[[nodiscard]] Result<ParticipantConfig> parse_participant_config(std::string_view text,
                                                                 const std::filesystem::path& file);

}  // namespace abbe::daemon
