#pragma once
/// The readers of the configuration file, one per group of tables. Each reader sets the valid
/// values, adds a fault for each invalid value, and closes its sections.

#include "abbe/config/config.hpp"
#include "abbe/config/mtconnect_config.hpp"
#include "abbe/config/notify_config.hpp"
#include "abbe/config/web_config.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "abbe/settings/section.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

/// Reads all tables. `base`: folder of the file, for relative paths.
[[nodiscard]] Config read_all(const Section& file, const std::filesystem::path& base);

void read_machine(ClassifiedSection& root, MachineConfig& out);
void read_thermal(ClassifiedSection& root, Config& out);
void read_air(ClassifiedSection& root, Config& out);
void read_sensors(ClassifiedSection& root, Config& out);
void read_daemon(ClassifiedSection& root, const std::filesystem::path& base, Config& out);
void read_recording(ClassifiedSection& root, const std::filesystem::path& base, Config& out);
void read_models(ClassifiedSection& root, ModelRetention& out);
void read_participant(ClassifiedSection& root, const std::filesystem::path& base, Config& out);
void read_gate(ClassifiedSection& root, Config& out);
void read_otf(ClassifiedSection& root, OtfConfig& out);
void read_drift(ClassifiedSection& root, Config& out);
void read_evemu(ClassifiedSection& root, Config& out);
void read_mfb(ClassifiedSection& root, Config& out);
void read_control(ClassifiedSection& root, const std::filesystem::path& base, Config& out);
[[nodiscard]] WebConfig read_web(Section section, const std::filesystem::path& base);
[[nodiscard]] MtconnectConfig read_mtconnect(Section section);
[[nodiscard]] NotifyConfig read_notify(Section section, const std::filesystem::path& base);
/// Adds a fault for each file of [notify] that is missing or that other users may read.
void check_notify_files(Section section, const NotifyConfig& config);

}  // namespace abbe::daemon
