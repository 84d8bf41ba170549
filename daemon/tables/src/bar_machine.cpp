// Checks the machine for an identification with a Multi-Feature Bar.
#include <fmt/format.h>

#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "toml_file.hpp"

namespace abbe::daemon {

Result<void> check_bar_machine(const std::filesystem::path& file, const MachineConfig& machine) {
  constexpr std::size_t kFewestCubicNodes = 4;
  if (machine.interpolation == TableInterpolation::Linear) return {};
  const auto parsed = parse_toml_file(file);
  ABBE_TRY(parsed);

  Faults faults(file.string());
  Section root(&parsed->table, "", {1, 1}, faults);
  Section axes = root.child("axes");
  for (const auto& [axis, nodes_m] : machine.nodes_m)
    if (nodes_m.size() < kFewestCubicNodes)
      axes.child(axis).fault("max_mm", fmt::format("{} nodes, cubic tables of an identification "
                                                   "with a bar need at least {}: check [model]",
                                                   nodes_m.size(), kFewestCubicNodes));
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return {};
}

}  // namespace abbe::daemon
