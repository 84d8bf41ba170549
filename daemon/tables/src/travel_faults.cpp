#include "abbe/tables/travel_faults.hpp"

#include <fmt/format.h>

#include <array>

#include "abbe/base/faults.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

Result<void> check_travel(const std::filesystem::path& file,
                          std::span<const calib::Vector3> positions_m,
                          std::span<const std::size_t> lines, const MachineConfig& config) {
  const auto machine = otf_machine(config);
  ABBE_TRY(machine);
  const auto& travel = machine->nodes;
  const auto outside = calib::outside_travel(positions_m, travel);
  if (outside.empty()) return {};
  constexpr std::array kColumns{"x_mm", "y_mm", "z_mm"};
  const std::string fits = calib::corrections_inside_travel(positions_m, travel);
  Faults faults(file.string());

  for (const auto& [point, axis] : outside) {
    const auto& nodes_m = travel[axis].nodes_m;
    faults.add_kind(
        "travel", lines[point], 1, kColumns[axis],
        fmt::format("{:g}: axis {} travels {:g} to {:g} mm{}",
                    kMmPerM * positions_m[point][static_cast<Eigen::Index>(axis)], "XYZ"[axis],
                    kMmPerM * nodes_m.front(), kMmPerM * nodes_m.back(), fits));
  }

  return tl::unexpected(faults.to_error());
}

}  // namespace abbe::daemon
