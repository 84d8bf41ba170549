#pragma once
/// How far two models are apart where it matters: after the rigid motion no measurement can see is
/// taken out.

#include <span>
#include <vector>

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

struct VectorStatistics {
  double mean_m = 0.0;  ///< mean length ("mae")
  double rms_m = 0.0;
  double max_m = 0.0;
};
[[nodiscard]] VectorStatistics vector_statistics(std::span<const Vector3> v_m);

struct ModelDifference {
  VectorStatistics as_stated;       ///< of the difference of V in the gauges the models have
  VectorStatistics rigid_free;      ///< after removing the best-fit T + r x p
  Vector6 rigid = Vector6::Zero();  ///< tx ty tz [m], rx ry rz [rad] that was removed
};

/// Least squares T + r x p of `difference` over points p = axis position + tool offset; needs 3
/// points not on a line.
[[nodiscard]] Result<ModelDifference> rigid_free(std::span<const Vector3> points_m,
                                                 std::span<const Vector3> difference_m);

/// Least squares s of V = s p + rigid motion: about the mean of the points, translation and
/// rotation do not matter. 0 for points in one place.
[[nodiscard]] double common_scale(std::span<const Vector3> points_m, std::span<const Vector3> V_m);

/// a - b at `axis_positions_m`. NotApplicable if one of them does not hold for the tool.
[[nodiscard]] Result<ModelDifference> rigid_free_difference(
    const VolumetricModel& a, const VolumetricModel& b, const Vector3& tool_offset_m,
    std::span<const Vector3> axis_positions_m);

/// All combinations of the three coordinate lists, x slowest.
[[nodiscard]] std::vector<Vector3> tensor_grid(const MachineNodes&);

}  // namespace abbe::calib
