#include <fmt/format.h>
#include <fmt/ranges.h>

#include <system_error>

#include "abbe/base/units.hpp"
#include "abbe/config/check_config.hpp"
#include "config_kind.hpp"

namespace abbe::daemon {

namespace {

using Lines = std::vector<std::string>;

std::string line(std::string_view what, std::string_view text) {
  return fmt::format("{:<13} {}", what, text);
}

/// The absolute path: it stays valid when the current folder changes.
std::string full(const std::filesystem::path& path) {
  std::error_code error;
  const auto absolute = std::filesystem::absolute(path, error);
  return (error ? path : absolute).lexically_normal().string();
}

std::string axis_text(const AxisConfig& axis, const MachineConfig& machine) {
  if (axis.kind == AxisKind::Rotary) return fmt::format("{:.9g} to {:.9g} rad", axis.min, axis.max);
  const auto nodes = machine.nodes_m.find(axis.name);
  return fmt::format("{:.9g} to {:.9g} mm, travel {:.9g} mm, {} nodes", axis.min * kMmPerM,
                     axis.max * kMmPerM, (axis.max - axis.min) * kMmPerM,
                     nodes == machine.nodes_m.end() ? 0 : nodes->second.size());
}

void add_machine(const MachineConfig& machine, Lines& out) {
  out.push_back(line("machine", fmt::format("\"{}\", chain {}", machine.name, machine.chain)));
  for (const auto& axis : machine.axes)
    out.push_back(line("axis " + axis.name, axis_text(axis, machine)));
  const auto& t = machine.target_offset_m;
  out.push_back(
      line("target", machine.target_given
                         ? fmt::format("{:.9g}, {:.9g}, {:.9g} mm from the tool reference "
                                       "point",
                                       t[0] * kMmPerM, t[1] * kMmPerM, t[2] * kMmPerM)
                         : "not given"));
}

void add_devices(const Config& config, Lines& out) {
  for (const ConfigKind& kind : config_kinds())
    for (const auto& text : kind.summary(config)) out.push_back(line(kind.key, text));
}

void add_folders(const Config& config, Lines& out) {
  out.push_back(line("recordings", full(config.recording.dir)));
  out.push_back(line("models", full(config.daemon.models_dir())));
  out.push_back(line("control", full(config.control.socket)));
  if (config.dds.supervise == Supervise::Off) {
    out.push_back(line("DDS", "off"));
    return;
  }
  out.push_back(
      line("DDS", fmt::format("domain {}, profile {}, keys {}", config.dds.domain,
                              config.dds.profile.empty() ? "built in" : full(config.dds.profile),
                              config.dds.security.empty() ? "none" : full(config.dds.security))));
}

}  // namespace

std::vector<std::string> summary_of(const Config& config) {
  Lines lines;
  add_machine(config.machine, lines);
  add_devices(config, lines);
  add_folders(config, lines);
  return lines;
}

}  // namespace abbe::daemon
