#pragma once
/// The points of interest O_i of a Multi-Feature Bar, one per hole [Viprey 2016, section 2]:
/// 1. PL_j and PR_j: points at which the axis of rod j meets its left and right plane.
/// 2. The plane of hole i (1 < i < N): least-squares plane through PL_{i-1}, PR_{i-1}, PL_i, PR_i.
///    The holes at the ends have one rod only; their plane is the reference plane, the
///    least-squares plane through PL_1, PR_1, PL_{N-1}, PR_{N-1}.
/// 3. O_i: point at which the axis of hole i meets its plane.
/// 4. Bar frame: origin O_1, x from O_1 to O_N, z normal of the reference plane, y = z x x. O_1 and
///    O_N lie in the reference plane, so x is perpendicular to z.
/// x and y of O_i come from the touches of its hole, z from the touches of the rods beside it. The
/// machine errors in O_i are therefore those at the touched places, not at O_i.
/// Tip radius and constant pre-travel do not move O_i. Lengths in m.

#include "abbe/calib/mfb/run/features.hpp"

namespace abbe::calib::mfb {

struct PointsOfInterest {
  std::vector<Vector3> O_m;            ///< in the frame of the touches
  Matrix3 axes = Matrix3::Identity();  ///< bar axes x, y, z as columns, in the frame of the touches
  /// O_i in the bar frame: axes^T (O_i - O_1)
  std::vector<Vector3> O_bar_m;

  /// Outward normals of the touched surfaces, in the order of BarTouches::count(): away from the
  /// axis of a cylinder, away from the bar for a plane.
  std::vector<Vector3> normals;
  /// Derivatives of O_m and of O_bar_m (x1 y1 z1 x2 ...) with respect to a displacement of each
  /// touch along its normal. Displacements along the surface have no effect to first order.
  Eigen::MatrixXd dO_dtouch, dO_bar_dtouch;
};

/// Computes the points. `axes` as in fit_features(), whose errors it returns. DegenerateGeometry:
/// the axis of a rod is parallel to its plane, or the axis of a hole to the plane of its rods.
[[nodiscard]] Result<PointsOfInterest> points_of_interest(const BarTouches&, const Matrix3& axes);

}  // namespace abbe::calib::mfb
