// SPDX-License-Identifier: GPL-2.0-or-later
#include "correction_field.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

namespace abbe::linuxcnc {
namespace {

constexpr double kMillimetre = 1e-3;

using Vector = Eigen::Vector3d;

Vector from_mm(const double (&v_mm)[3]) {
  return Vector(v_mm[0], v_mm[1], v_mm[2]) * kMillimetre;
}

/// Values that are not valid, with a formatted reason, which is truncated to the size in the
/// memory.
template <class... Values>
abbe_wanted refuse(fmt::format_string<Values...> reason, Values&&... values) {
  abbe_wanted refused{};
  fmt::format_to_n(&refused.reason[0], ABBE_REASON_SIZE - 1, reason,
                   std::forward<Values>(values)...);
  return refused;
}

/// True if the field holds for the tool offset, as VolumetricModel::holds_for_tool() for a model
/// for one tool. The published data do not show whether a model holds for more tools. A tool offset
/// that is NaN gives false.
bool holds_for(const Vector& tool_m, const Usable& usable) {
  return (tool_m - usable.tool_offset_m).norm() <= kToolTolerance_m;
}

abbe_wanted refuse_tool(const Vector& tool_m, int number, const Usable& usable) {
  const Vector t = tool_m / kMillimetre, of_model = usable.tool_offset_m / kMillimetre;
  return refuse(
      "the model is for the tool offset ({:.3f}, {:.3f}, {:.3f}) mm, T{} has "
      "({:.3f}, {:.3f}, {:.3f}) mm",
      of_model.x(), of_model.y(), of_model.z(), number, t.x(), t.y(), t.z());
}

}  // namespace

std::optional<Eigen::Vector3d> command_correction(const daemon::ErrorLattice& field,
                                                  const Eigen::Vector3d& position_m) {
  // Each pass multiplies the remaining error by the slope of V, which is at most 1e-3; three passes
  // leave 1e-9 of c.
  constexpr int kPasses = 3;
  if (!position_m.allFinite()) return std::nullopt;

  Eigen::Vector3d correction_m = Eigen::Vector3d::Zero();
  for (int pass = 0; pass < kPasses; ++pass) {
    Eigen::Vector3d V_m;
    if (!field.at(position_m + correction_m, V_m)) return std::nullopt;
    correction_m = -V_m;
  }
  return correction_m;
}

abbe_wanted wanted(const Usable& usable, double silence_s, const abbe_control& control,
                   const FeedOptions& options) {
  if (control.homed == 0) return refuse("not all joints are homed");
  if (silence_s > options.longest_silence_s) return refuse("the DDS subscription does not answer");
  if (!usable.field) return refuse("{}", usable.reason);

  if (control.tool == ABBE_TOOL_NOT_LINKED)
    return refuse("abbe-correction.tool-offset.x, y, z and tool-number are not all linked in HAL");
  if (control.tool != ABBE_TOOL_KNOWN)
    return refuse("the offset of T{} is not applied yet: G43 (after G49, if it equals that before)",
                  control.tool_number);
  const Vector tool_m = options.tool_offset_at_zero_m - from_mm(control.tool_offset);
  if (!holds_for(tool_m, usable)) return refuse_tool(tool_m, control.tool_number, usable);

  const auto correction_m = command_correction(*usable.field, from_mm(control.position));
  if (!correction_m) return refuse("outside the volume of the model");
  // The comparison also refuses if the clamp is NaN.
  if (!(correction_m->cwiseAbs().maxCoeff() <= options.clamp_m))
    return refuse("the correction is larger than the clamp");

  abbe_wanted w{};
  w.valid = 1;
  for (int i = 0; i < 3; ++i) w.correction[i] = (*correction_m)[i] / kMillimetre;
  return w;
}

}  // namespace abbe::linuxcnc
