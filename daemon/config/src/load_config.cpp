#include <algorithm>

#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "config_kind.hpp"
#include "readers.hpp"

namespace abbe::daemon {

Config read_all(const Section& file, const std::filesystem::path& base) {
  Config config;
  ClassifiedSection root(file, "", config.meaning);
  StreamNames names;
  read_machine(root, config.machine);
  read_daemon(root, base, config);  // first, because devices depend on [daemon] simulated
  for (const ConfigKind& kind : config_kinds()) kind.read(root, config, names);
  read_thermal(root, config);
  read_air(root, config);
  read_sensors(root, config);
  read_recording(root, base, config);
  read_models(root, config.models);
  read_participant(root, base, config);
  read_gate(root, config);
  read_otf(root, config.otf);
  read_drift(root, config);
  read_evemu(root, config);
  read_mfb(root, config);
  read_control(root, base, config);
  // Checked only: abbe-web, abbe-mtconnect and abbe-notify use them.
  (void)read_web(root.operation_table("web"), base);
  (void)read_mtconnect(root.operation_table("mtconnect"));
  (void)read_notify(root.operation_table("notify"), base);
  for (const ConfigKind& kind : config_kinds())
    if (kind.state != nullptr) kind.state(root, config);
  root.close();

  return config;
}

namespace {

Result<Config> parse(std::string_view text, const std::filesystem::path& file, Origin origin) {
  const auto table = parse_toml(text, file.string());
  ABBE_TRY(table);
  Faults faults(file.string(), kMostConfigFaults);
  Section root(&*table, "", {1, 1}, faults, origin);
  auto config = read_all(root, file.parent_path());
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return config;
}

}  // namespace

Result<Config> parse_config(std::string_view text, const std::filesystem::path& file) {
  return parse(text, file, Origin::Written);
}

Result<Config> parse_recorded_config(std::string_view text, const std::filesystem::path& file) {
  return parse(text, file, Origin::Recorded);
}

Result<Config> load_config(const std::filesystem::path& file) {
  const auto text = read_configuration_text(file);
  ABBE_TRY(text);
  return parse_config(*text, file);
}

std::vector<std::string> Config::connected_axes() const {
  std::vector<std::string> names;
  for (const AxisReadings& readings : axis_readings(*this))
    names.insert(names.end(), readings.axes.begin(), readings.axes.end());
  return names;
}

bool Config::axes_compensated() const {
  return std::ranges::any_of(axis_readings(*this), &AxisReadings::compensated);
}

}  // namespace abbe::daemon
