#include "axis_steps.hpp"

#include <fmt/format.h>

#include <cmath>

#include "abbe/base/units.hpp"

namespace abbe::daemon {

namespace {

constexpr double kCoarseStep_m = 10e-6, kCoarseStep_rad = 1e-3;

}  // namespace

void check_step(ClassifiedSection& section, double step, bool linear) {
  if (std::abs(step) <= (linear ? kLargestStep_m : kLargestStep_rad)) return;
  if (linear)
    section.implausible("step_nm",
                        fmt::format("one count is {:g} mm, but must be at most {:g} mm: no "
                                    "scale is coarser. step_nm is in nanometres",
                                    step * kMmPerM, kLargestStep_m * kMmPerM));
  else
    section.implausible("step_nrad",
                        fmt::format("one count is {:g} rad, but must be at most {:g} rad: "
                                    "no encoder is coarser. step_nrad is in nanoradians",
                                    step, kLargestStep_rad));
}

void doubt_steps(Section& root, const char* table, const char* list, const MachineConfig& machine) {
  for (auto& section : root.child(table).children(list)) {
    std::string name;
    section.get("axis", name);
    const AxisConfig* axis = machine.find_axis(name);
    const bool linear = axis == nullptr || axis->kind == AxisKind::Linear;
    const char* const key = linear ? "step_nm" : "step_nrad";
    double step = 0.0;

    if (!section.get(key, step, kNano, kAny) || step <= (linear ? kCoarseStep_m : kCoarseStep_rad))
      continue;
    section.fault(key, linear ? fmt::format("one count is {:g} um", step * kUmPerM)
                              : fmt::format("one count is {:g} urad", step * kUradPerRad));
  }
}

std::string step_text(double step, bool linear) {
  return fmt::format("{:g} {}", step * 1e9, linear ? "nm" : "nrad");
}

}  // namespace abbe::daemon
