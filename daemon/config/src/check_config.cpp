#include "abbe/config/check_config.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <system_error>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "config_kind.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

namespace fs = std::filesystem;

// ---- Files and folders of this computer that the configuration names ----

/// `folder` if it exists, else the nearest folder above it that exists. Empty if this cannot be
/// determined.
fs::path existing_part(const fs::path& folder) {
  std::error_code error;
  auto part = fs::absolute(folder, error).lexically_normal();
  while (!error && !fs::exists(part, error) && !error && part.has_relative_path())
    part = part.parent_path();
  return error ? fs::path{} : part;
}

/// Adds a fault unless `folder` exists or can be created by abbed.
void check_folder(Section section, std::string_view key, const fs::path& folder) {
  std::error_code error;
  const auto part = existing_part(folder);
  if (part.empty() || fs::is_directory(part, error) || error) return;
  section.fault(key, fmt::format("{} cannot be a folder: {} is a file. Give another folder",
                                 folder.string(), part.string()));
}

/// True if the path does not exist. False also if the path cannot be examined, for example because
/// this user may not search a folder above it; abbed may then be able to see the file.
bool is_missing(const fs::path& path, bool folder) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (error && status.type() != fs::file_type::not_found) return false;
  return folder ? !fs::is_directory(status) : !fs::is_regular_file(status);
}

void check_dds_files(Section dds, const DdsConfig& config) {
  if (config.supervise == Supervise::Off) return;  // abbed does not read these files then
  if (!config.profile.empty() && is_missing(config.profile, false))
    dds.fault("profile", fmt::format("there is no file {}. Without this key the built-in profile "
                                     "is used",
                                     config.profile.string()));
  if (!config.security.empty() && is_missing(config.security, true))
    dds.fault("security", fmt::format("there is no folder {}. `abbe dds keys` makes the keys",
                                      config.security.string()));
}

void check_paths(Section& root, const Config& config) {
  Section daemon = root.child("daemon");
  check_folder(daemon, "data_dir", config.daemon.data_dir);
  check_folder(daemon, "runtime_dir", config.daemon.runtime_dir);
  if (Section recording = root.child("recording"); recording.has("dir"))
    check_folder(recording, "dir", config.recording.dir);
  check_dds_files(root.child("dds"), config.dds);
}

/// Adds a fault for each missing file of [notify]. abbed does not read these files: it also starts
/// without them.
void check_files_of_notify(Section notify, const fs::path& base) {
  check_notify_files(notify, read_notify(notify, base));
}

// ---- Improbable values ----

constexpr double kLongTravel_m = 50.0;
// 62.8 rad; a larger value was probably entered in degrees
constexpr double kManyTurns_rad = 10 * 2.0 * std::numbers::pi;
constexpr double kLongTarget_m = 2.0;

void doubt_axis(Section axis, const AxisConfig& config) {
  const double range = config.max - config.min;
  if (config.kind == AxisKind::Linear && range > kLongTravel_m)
    axis.fault("max_mm", fmt::format("the travel is {:g} m. min_mm and max_mm are in mm", range));
  if (config.kind == AxisKind::Rotary && range > kManyTurns_rad)
    axis.fault("max_rad", fmt::format("the range is {:.3g} revolutions. min_rad and max_rad are in "
                                      "rad, not in degrees",
                                      range / (2.0 * std::numbers::pi)));
}

void doubt_target(Section target, const MachineConfig& machine) {
  if (!machine.target_given) {
    target.fault("offset_mm", "missing: no calibration is possible without it");
    return;
  }
  for (const double offset_m : machine.target_offset_m) {
    if (std::abs(offset_m) <= kLongTarget_m) continue;
    target.fault("offset_mm", fmt::format("the reflector is {:g} m from the tool reference point. "
                                          "offset_mm is in mm",
                                          std::abs(offset_m)));
    return;
  }
}

void doubt_nodes(Section model, const MachineConfig& machine) {
  for (const auto& [axis, nodes_m] : machine.nodes_m) {
    if (nodes_m.size() > 2) continue;
    model.fault("node_spacing_mm",
                fmt::format("axis {} has only {} nodes: the model of its errors is a straight line",
                            axis, nodes_m.size()));
  }
}

void doubt_machine(Section& root, const MachineConfig& machine) {
  Section axes = root.child("axes");
  for (const auto& axis : machine.axes) doubt_axis(axes.child(axis.name), axis);
  doubt_target(root.child("target"), machine);
  doubt_nodes(root.child("model"), machine);
}

void doubt_cpus(Section daemon, const DaemonConfig& config, int cpus) {
  for (const auto& [key, cpu] :
       {std::pair{"tracker_cpu", config.tracker_cpu}, std::pair{"encoder_cpu", config.encoder_cpu},
        std::pair{"hub_cpu", config.hub_cpu}})
    if (cpu && *cpu >= cpus)
      daemon.fault(key, fmt::format("CPU {}: this computer has the CPUs 0 to {}", *cpu, cpus - 1));
}

/// Warns about paths with "~" or "$HOME". No shell expands them, and a folder with that literal
/// name would be created.
void doubt_paths(Section& root, const Config& config) {
  const auto doubt = [&](const char* table, const char* key, const fs::path& path) {
    const bool shell = std::ranges::any_of(path, [](const fs::path& part) {
      return part.string().starts_with('~') || part.string().starts_with('$');
    });
    if (shell) root.child(table).fault(key, fmt::format("{} is used as written", path.string()));
  };

  doubt("daemon", "data_dir", config.daemon.data_dir);
  doubt("daemon", "runtime_dir", config.daemon.runtime_dir);
  if (root.child("recording").has("dir")) doubt("recording", "dir", config.recording.dir);
}

void doubt_devices(Section& root, const Config& config) {
  if (axis_readings(config).empty())
    root.fault("", fmt::format("no {}: no device reads the axes", needed_for(Capability::Axes)));
  if (!tracker_source(config) && !touch_source(config))
    root.fault("",
               fmt::format("no {}: no device measures the errors", needed_for(Capability::Errors)));
  if (config.daemon.simulated)
    root.child("daemon").fault("simulated", "the devices are those of abbe-sim, not of a machine");
}

// ---- Values left from the example file ----

/// Values of the examples abbed.toml and first_abbed.toml. No other machine has all of them.
constexpr std::string_view kExampleName = "mill 7", kExampleHost = "192.168.0.1";
constexpr std::array<std::pair<double, double>, 3> kExampleTravel_m{
    {{-0.3, 0.3}, {-0.25, 0.25}, {-0.4, 0.0}}};
constexpr std::array kExampleTarget_m{0.02, -0.015, -0.12};

/// True if both lengths are equal except for rounding of the conversion from mm.
bool same_length(double a_m, double b_m) {
  return std::abs(a_m - b_m) < 1e-9;
}

bool has_example_travel(const MachineConfig& machine) {
  return std::ranges::equal(
      machine.axes, kExampleTravel_m, [](const auto& axis, const auto& travel) {
        return same_length(axis.min, travel.first) && same_length(axis.max, travel.second);
      });
}

bool has_example_target(const MachineConfig& machine) {
  return machine.target_given &&
         std::ranges::equal(machine.target_offset_m, kExampleTarget_m, same_length);
}

std::vector<std::string> left_of_the_example(const toml::table& table,
                                             const MachineConfig& machine) {
  std::vector<std::string> left;
  if (machine.name == kExampleName)
    left.push_back(fmt::format("machine.name \"{}\"", kExampleName));
  if (has_example_travel(machine)) left.emplace_back("the travel of X, Y and Z");
  if (has_example_target(machine)) left.emplace_back("target.offset_mm");
  for (const auto& [name, values] : table) {
    const toml::table* section = values.as_table();
    if (section != nullptr && (*section)["host"].value_or(std::string_view{}) == kExampleHost)
      left.push_back(fmt::format("{}.host \"{}\"", name.str(), kExampleHost));
  }
  // A single equal value may be correct: some machines have this travel, and trackers leave the
  // factory with this address.
  constexpr std::size_t kFewest = 2;
  return left.size() >= kFewest ? left : std::vector<std::string>{};
}

/// A text "file:line:column: key: what" for every value that is possible but improbable.
std::vector<std::string> warnings_of(const toml::table& table, const Config& config, int cpus,
                                     const std::string& file) {
  Faults warnings(file, kMostConfigFaults);
  Section root(&table, "", {1, 1}, warnings);
  doubt_machine(root, config.machine);
  for (const ConfigKind& kind : config_kinds())
    if (kind.doubt != nullptr) kind.doubt(root, config);
  doubt_devices(root, config);
  doubt_cpus(root.child("daemon"), config.daemon, cpus);
  doubt_paths(root, config);
  return warnings.lines();
}

}  // namespace

Result<CheckedConfig> check_config(const fs::path& file, int cpus) {
  const auto text = read_configuration_text(file);
  ABBE_TRY(text);
  const auto table = parse_toml(*text, file.string());
  ABBE_TRY(table);
  Faults faults(file.string(), kMostConfigFaults);
  Section root(&*table, "", {1, 1}, faults);

  CheckedConfig checked{
      .config = read_all(root, file.parent_path()), .warnings = {}, .of_the_example = {}};
  check_paths(root, checked.config);
  if (!faults.any()) check_files_of_notify(root.child("notify"), file.parent_path());
  if (faults.any()) return tl::make_unexpected(faults.to_error());

  checked.warnings = warnings_of(*table, checked.config, cpus, file.string());
  checked.of_the_example = left_of_the_example(*table, checked.config.machine);
  return checked;
}

}  // namespace abbe::daemon
