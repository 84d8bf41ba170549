#include "abbe/config/calibration_machine.hpp"

#include "abbe/config/calib_error.hpp"

#include <fmt/format.h>

#include <string>

namespace abbe::daemon {

Result<calib::otf::Machine> otf_machine(const MachineConfig& machine) {
  auto chain = calib::KinematicChain::parse(machine.chain);
  if (!chain) return tl::unexpected(error_of(chain.error()));
  calib::otf::Machine out;
  out.chain = *chain;

  for (const calib::Axis a : calib::kAllAxes) {
    const std::string axis_name(1, calib::letter(a));
    const AxisConfig* axis = machine.find_axis(axis_name);
    const auto nodes = machine.nodes_m.find(axis_name);
    if (axis == nullptr || nodes == machine.nodes_m.end()) {
      return fail(ErrorCode::BadInput,
                  fmt::format("machine {}: axis {} has no range", machine.name, axis_name));
    }
    out.nodes[calib::index(a)] = {.nodes_m = nodes->second, .reference_m = axis->reference};
  }

  out.target_offset_m = {machine.target_offset_m[0], machine.target_offset_m[1],
                         machine.target_offset_m[2]};
  out.interpolation = machine.interpolation;
  return out;
}

Result<void> require_target(const MachineConfig& machine) {
  if (machine.target_given) return {};
  return fail(
      ErrorCode::BadInput,
      fmt::format(
          "machine {}: [target] offset_mm is missing: add [target] with offset_mm = [x, y, z], the "
          "centre of the reflector or stylus tip relative to the tool reference point, in mm along "
          "the machine axes; [0, 0, 0] if the two points coincide",
          machine.name));
}

}  // namespace abbe::daemon
