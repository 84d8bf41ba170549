#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "abbe/base/sha256.hpp"
#include "abbe/config/bounded_toml.hpp"
#include "config_kind.hpp"
#include "readers.hpp"

namespace abbe::daemon {

Config read_all(Section& root, const std::filesystem::path& base) {
  Config config;
  StreamNames names;
  read_machine(root, config.machine);
  read_daemon(root, base, config);  // first, because devices depend on [daemon] simulated
  for (const ConfigKind& kind : config_kinds()) kind.read(root, config, names);
  read_thermal(root, config);
  read_air(root, config);
  read_sensors(root, config);
  read_recording(root, base, config);
  read_dds(root, base, config);
  read_gate(root, config);
  read_otf(root, config.otf);
  read_drift(root, config);
  read_evemu(root, config);
  read_control(root, base, config);
  (void)read_web(root, base);  // checked only: abbe-web uses it
  (void)read_mtconnect(root);  // checked only: abbe-mtconnect uses it
  root.close();

  return config;
}

Result<std::string> read_configuration_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  if (in && in.peek() != std::ifstream::traits_type::eof()) text << in.rdbuf();
  if (in.bad() || !in.is_open())
    return fail(ErrorCode::Io, fmt::format("read {}: {}", file.string(), std::strerror(errno)));
  return text.str();
}

namespace {

Result<Config> parse(std::string_view text, const std::filesystem::path& file, Origin origin) {
  const auto table = parse_toml(text, file.string());
  if (!table) return tl::make_unexpected(table.error());
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
  if (!text) return tl::make_unexpected(text.error());
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

std::string machine_hash(const Config& config) {
  const MachineConfig& machine = config.machine;
  std::string text = fmt::format("{}|{}|0", machine.name, machine.chain);
  for (const auto& axis : machine.axes)
    text += fmt::format("|{} {} {:.17g} {:.17g} {:.17g}", axis.name, static_cast<int>(axis.kind),
                        axis.min, axis.max, axis.reference);
  for (const double t : machine.target_offset_m) text += fmt::format("|{:.17g}", t);

  for (const auto& [axis, nodes_m] : machine.nodes_m) {
    text += "|" + axis;
    for (const double node_m : nodes_m) text += fmt::format(" {:.17g}", node_m);
  }

  for (const ConfigKind& kind : config_kinds())
    if (kind.reading_text != nullptr) text += kind.reading_text(config);
  for (const auto& thermal : config.thermal)
    text += fmt::format("|thermal {} {:.17g} {:.17g} {}", thermal.axis, thermal.alpha_per_K,
                        thermal.fixed_m, config.temperatures[thermal.temperature]);

  return sha256_hex(text);
}

}  // namespace abbe::daemon
