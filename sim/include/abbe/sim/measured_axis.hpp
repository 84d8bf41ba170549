#pragma once
/// The axis that a scale of the virtual machine measures: one of its linear axes, or a rotary axis.
/// Errors of rotary axes are not simulated: their motion does not move the target.

#include <variant>

#include "abbe/sim/virtual_machine.hpp"

namespace abbe::sim {

/// Sinusoidal motion about 0 that begins when the machine starts.
struct RotarySwing {
  double amplitude_rad = 0.1;
  double period_s = 10.0;
};

using MeasuredAxis = std::variant<Axis, RotarySwing>;

/// Scale reading, m or rad.
[[nodiscard]] double reading(const MeasuredAxis& axis, const VirtualMachine& machine, HostTime at);

}  // namespace abbe::sim
