#pragma once
/// The table [dds] of the configuration, for abbed, and for abbe-dds and abbe-watch, which read
/// nothing else of it.

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

/// Who runs abbe-dds. ByStart: systemd if abbed runs as abbed.service, else abbed itself;
/// use_dds_unit() decides it.
enum class Supervise { ByStart, Child, Systemd, Off };

/// [dds]
struct DdsConfig {
  std::uint32_t domain = 0;
  double snapshot_hz = 50.0;       ///< maximum rate; 0: with every hub cycle that has new data
  double compensation_hz = 100.0;  ///< maximum rate; 0: with every hub cycle that has new data
  /// A subscriber must not apply a compensation vector older than this.
  std::chrono::nanoseconds validity{std::chrono::milliseconds{500}};
  Supervise supervise = Supervise::ByStart;
  /// With Systemd: the user as which abbe-dds runs, which alone may connect; empty: that of abbed.
  std::string user = "abbe-dds";
  int priority = 20;  ///< SCHED_FIFO of abbe-dds, below hub and devices; 0: not SCHED_FIFO
  std::filesystem::path profile;  ///< XML profiles; empty: the built-in ones
  /// Folder of keys made by `abbe dds keys`; empty: the profile decides.
  std::filesystem::path security;
  /// Default: runtime_dir/dds.sock; with Systemd dds.sock in the folder "RUNTIME_DIR-dds", which
  /// abbe-dds may enter.
  std::filesystem::path socket;
};

/// Reads the table; the caller closes it. `base`: folder of the file, for relative paths;
/// `runtime_dir`: [daemon] runtime_dir.
void read_dds(Section&, const std::filesystem::path& base, const std::filesystem::path& runtime_dir,
              DdsConfig& out);

/// Decides [dds] supervise, if the configuration does not, and the socket that follows from it.
/// `unit`: abbed runs as abbed.service, beside abbe-dds.service.
void use_dds_unit(DdsConfig&, const std::filesystem::path& runtime_dir, bool unit);

/// What a process beside abbed needs of a configuration.
struct ParticipantConfig {
  std::filesystem::path runtime_dir = kRuntimeFolder;
  DdsConfig dds;
};
/// Reads [dds] and [daemon] runtime_dir. Other tables are not checked: abbed does that. Io if the
/// file cannot be read, BadInput with the faults as load_config().
[[nodiscard]] Result<ParticipantConfig> load_participant_config(const std::filesystem::path& file);
/// `file`: for relative paths and for messages.
[[nodiscard]] Result<ParticipantConfig> parse_participant_config(std::string_view text,
                                                                 const std::filesystem::path& file);

}  // namespace abbe::daemon
