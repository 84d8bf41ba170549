#include "abbe/sim/measured_axis.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace abbe::sim {

double reading(const MeasuredAxis& axis, const VirtualMachine& machine, HostTime at) {
  if (const auto* const linear = std::get_if<Axis>(&axis))
    return machine.motion(at).q_m[static_cast<Eigen::Index>(*linear)];
  const auto& swing = std::get<RotarySwing>(axis);
  const double moved_s = std::max(0.0, machine.elapsed_s(at));
  return swing.amplitude_rad * std::sin(2.0 * std::numbers::pi * moved_s / swing.period_s);
}

}  // namespace abbe::sim
