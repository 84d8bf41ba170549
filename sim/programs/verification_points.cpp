#include "verification_points.hpp"

#include <fmt/format.h>

#include "bar_options.hpp"

namespace abbe::sim {

std::string verification_csv(const TruthMachine& machine) {
  constexpr int kPerAxis = 6;
  const Eigen::Vector3d offset_mm = machine.target_offset_m / kFromMilli;
  std::string text = fmt::format(
      "# the true place of the tip of the tool with the offset {:g},{:g},{:g} mm\n"
      "x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm\n",
      offset_mm.x(), offset_mm.y(), offset_mm.z());
  const auto at = [&](Axis axis, int i) {
    const AxisRange& r = machine.axis(axis).range;
    return r.min_m + (r.max_m - r.min_m) * i / (kPerAxis - 1);
  };

  for (int i = 0; i < kPerAxis * kPerAxis * kPerAxis; ++i) {
    const Eigen::Vector3d q_m(at(Axis::X, i / (kPerAxis * kPerAxis)),
                              at(Axis::Y, i / kPerAxis % kPerAxis), at(Axis::Z, i % kPerAxis));
    const Eigen::Vector3d q_mm = q_m / kFromMilli, p_mm = position_m(machine, q_m) / kFromMilli;
    text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", q_mm.x(), q_mm.y(),
                        q_mm.z(), p_mm.x(), p_mm.y(), p_mm.z());
  }
  return text;
}

}  // namespace abbe::sim
