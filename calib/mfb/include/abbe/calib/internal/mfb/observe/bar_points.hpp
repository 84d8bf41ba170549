#pragma once
/// Points of interest and pose, computed from the features of a bar without derivatives
/// (points_of_interest.hpp, steps 1 to 4).

#include <span>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"
#include "abbe/calib/mfb/run/features.hpp"

namespace abbe::calib::mfb {

struct BarPoints {
  std::vector<Vector3> O_m;
  BarPose pose;
};

/// Unit normal of the least-squares plane through points with the scatter matrix S = sum c c^T, c:
/// points relative to their centroid. `near`: approximate normal. In a frame with the normal n and
/// two directions e across it, n is the best one if e^T S n = 0. The step
///     n -> n - e (e^T S e)^-1 e^T S n
/// is the vertical least-squares plane in this frame; its error decreases by the ratio of the
/// eigenvalues of S, so that three steps suffice for points within 1 % of a plane.
[[nodiscard]] Vector3 normal_of_scatter(const Matrix3& S, const Vector3& near);

/// An axis or a plane: a point, and the direction of the axis or the normal.
struct PointAndDirection {
  Vector3 point = Vector3::Zero(), direction = Vector3::UnitZ();
};
/// `planes`: two per rod, L before R. `up`: approximate z of the bar.
[[nodiscard]] Result<BarPoints> bar_points(std::span<const PointAndDirection> holes,
                                           std::span<const PointAndDirection> rods,
                                           std::span<const PointAndDirection> planes,
                                           const Vector3& up);
[[nodiscard]] Result<BarPoints> bar_points(const BarFeatures&, const Matrix3& axes);

}  // namespace abbe::calib::mfb
