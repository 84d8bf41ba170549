#pragma once
/// Difference between two models after removal of the best-fit rigid motion, which no measurement
/// can determine.

#include <span>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

struct VectorStatistics {
  double mean_m = 0.0;  ///< mean length ("mae")
  double rms_m = 0.0;
  double max_m = 0.0;
};
[[nodiscard]] VectorStatistics vector_statistics(std::span<const Vector3> v_m);

struct ModelDifference {
  VectorStatistics as_stated;       ///< statistics of the difference of V in the datums of the
                                    ///< models
  VectorStatistics rigid_free;      ///< statistics of the difference minus its best-fit rigid
                                    ///< motion T + r x p
  Vector6 rigid = Vector6::Zero();  ///< the removed tx ty tz [m], rx ry rz [rad]
};

/// Fits T + r x p to `difference_m` by least squares, p = axis position + tool offset. Needs at
/// least 3 points that are not on a line, else TooFewObservations or DegenerateGeometry.
[[nodiscard]] Result<ModelDifference> rigid_free(std::span<const Vector3> points_m,
                                                 std::span<const Vector3> difference_m);

/// The scale s of V = s p + rigid motion by least squares. Points are taken relative to their mean;
/// translation and rotation then have no influence on s. 0 if all points coincide.
[[nodiscard]] double common_scale(std::span<const Vector3> points_m, std::span<const Vector3> V_m);

/// V of a minus V of b at `axis_positions_m`, for a direction of travel (Unknown: the mean of
/// both). NotApplicable if a model is not valid for the tool.
[[nodiscard]] Result<ModelDifference> rigid_free_difference(
    const VolumetricModel& a, const VolumetricModel& b, const Vector3& tool_offset_m,
    std::span<const Vector3> axis_positions_m, const AxisTravel& travel = {});

/// All combinations of the node positions of X, Y and Z; z varies fastest.
[[nodiscard]] std::vector<Vector3> tensor_grid(const MachineNodes&);

}  // namespace abbe::calib
