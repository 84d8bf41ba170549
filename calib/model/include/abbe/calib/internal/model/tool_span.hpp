#pragma once

#include <algorithm>
#include <span>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// The tools for which a model is valid. `any`: every tool; else the tools on the line with
/// direction `line`, or one tool if `line` is zero.
struct ToolSpan {
  bool any = false;
  Vector3 line = Vector3::Zero();
};

/// Offsets closer to each other than kToolTolerance_m count as one offset; offsets closer than
/// kToolTolerance_m to a line count as on the line.
[[nodiscard]] inline ToolSpan tool_span(std::span<const Vector3> offsets_m) {
  const Vector3& first = offsets_m.front();
  Vector3 along = Vector3::Zero();
  for (const Vector3& t : offsets_m) {
    along = (t - first).norm() > along.norm() ? Vector3(t - first) : along;
  }

  if (!(along.norm() > VolumetricModel::kToolTolerance_m)) {
    return {};
  }

  const Vector3 line = along.normalized();
  const bool beside = std::any_of(offsets_m.begin(), offsets_m.end(), [&](const Vector3& t) {
    return (t - first - line * line.dot(t - first)).norm() > VolumetricModel::kToolTolerance_m;
  });

  return {beside, line};
}

}  // namespace abbe::calib
