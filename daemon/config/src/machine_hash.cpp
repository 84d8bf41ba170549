#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "abbe/base/sha256.hpp"
#include "config_kind.hpp"

namespace abbe::daemon {
namespace {

struct FormerKeys {
  std::string_view table;
  std::vector<std::string_view> keys;  ///< beginnings of the keys; empty: all keys
};

/// The keys that former_machine_hash() covers. This list must not change any more.
const std::vector<FormerKeys> kFormerKeys{
    {"machine", {}},
    {"axes", {}},
    {"target", {}},
    {"model", {}},
    {"encoder", {"axes_compensated", "node", "step_", "offset_", "invert"}},
    {"counter_card", {"axes_compensated", "channel", "step_", "offset_", "invert"}},
    {"reference", {"signal_period_", "increment", "zero_mark_", "reversed"}},
    {"cmm", {"axes_compensated"}},
    {"thermal", {"temperature", "alpha_", "fixed_"}}};

bool in_former_hash(std::string_view key) {
  const auto table = key.substr(0, key.find('.'));
  const auto name = key.substr(key.rfind('.') + 1);
  return std::ranges::any_of(kFormerKeys, [&](const FormerKeys& former) {
    return former.table == table &&
           (former.keys.empty() || std::ranges::any_of(former.keys, [&](std::string_view begin) {
              return name.starts_with(begin);
            }));
  });
}

}  // namespace

std::string machine_hash(const Config& config) {
  return hash_of(config.meaning.readings);
}

std::string former_machine_hash(const Config& config) {
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
    if (kind.former_text != nullptr) text += kind.former_text(config);
  for (const auto& thermal : config.thermal)
    text += fmt::format("|thermal {} {:.17g} {:.17g} {}", thermal.axis, thermal.alpha_per_K,
                        thermal.fixed_m, config.temperatures[thermal.temperature]);

  return sha256_hex(text);
}

MeaningEntries not_in_former_hash(MeaningEntries readings) {
  std::erase_if(readings, [](const MeaningEntry& entry) { return in_former_hash(entry.key); });
  return readings;
}

void set_target_offset(Config& config, const std::array<double, 3>& offset_m) {
  config.machine.target_offset_m = offset_m;
  config.machine.target_given = true;
  set_entry(config.meaning.readings, "target.offset_mm",
            numbers_text({offset_m.begin(), offset_m.end()}, kMilli.per_si));
}

}  // namespace abbe::daemon
