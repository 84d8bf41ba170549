#include "abbe/calib/model/model_comparison.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib {

VectorStatistics vector_statistics(std::span<const Vector3> v_m) {
  VectorStatistics s;
  double squares = 0.0;
  for (const Vector3& v : v_m) {
    s.mean_m += v.norm();
    squares += v.squaredNorm();
    s.max_m = std::max(s.max_m, v.norm());
  }
  if (!v_m.empty()) {
    s.mean_m /= static_cast<double>(v_m.size());
    s.rms_m = std::sqrt(squares / static_cast<double>(v_m.size()));
  }
  return s;
}

Result<ModelDifference> rigid_free(std::span<const Vector3> points_m,
                                   std::span<const Vector3> difference_m) {
  if (points_m.size() != difference_m.size() || points_m.size() < 3) {
    return failure(ErrorCode::TooFewObservations,
                   message("rigid motion from ", difference_m.size(), " vectors at ",
                           points_m.size(), " points: needs 3"));
  }

  Vector3 centre = Vector3::Zero();
  for (const Vector3& p : points_m) {
    centre += p;
  }

  centre /= static_cast<double>(points_m.size());
  // With points p relative to their centroid, translation and rotation are decoupled: the normal
  // equations of the n points have the block-diagonal matrix
  //     N = diag(n I, sum (|p|^2 I - p p^T)).
  Matrix3 inertia = Matrix3::Zero();
  Vector3 translation = Vector3::Zero(), moment = Vector3::Zero();

  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const Matrix3 E = rotation_effect(points_m[i] - centre);
    inertia.noalias() += E.transpose() * E;
    moment.noalias() += E.transpose() * difference_m[i];
    translation += difference_m[i];
  }

  translation /= static_cast<double>(points_m.size());
  const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(inertia, Eigen::EigenvaluesOnly);
  constexpr double kLine = 1e-12;

  if (!(eigen.eigenvalues()(0) > kLine * eigen.eigenvalues()(2))) {
    return failure(ErrorCode::DegenerateGeometry, "rigid motion: the points lie on a line");
  }

  const Vector3 rotation = inertia.ldlt().solve(moment);
  std::vector<Vector3> rest(difference_m.size());
  for (std::size_t i = 0; i < rest.size(); ++i) {
    rest[i] = difference_m[i] - translation - rotation_effect(points_m[i] - centre) * rotation;
  }

  ModelDifference result;
  result.as_stated = vector_statistics(difference_m);
  result.rigid_free = vector_statistics(rest);
  result.rigid << translation - rotation_effect(centre) * rotation, rotation;

  return result;
}

double common_scale(std::span<const Vector3> points_m, std::span<const Vector3> V_m) {
  Vector3 centre = Vector3::Zero();
  for (const Vector3& p : points_m) {
    centre += p / static_cast<double>(points_m.size());
  }
  double along = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    along += V_m[i].dot(points_m[i] - centre);
    squares += (points_m[i] - centre).squaredNorm();
  }
  return squares > 0.0 ? along / squares : 0.0;
}

Result<ModelDifference> rigid_free_difference(const VolumetricModel& a, const VolumetricModel& b,
                                              const Vector3& tool_offset_m,
                                              std::span<const Vector3> axis_positions_m,
                                              const AxisTravel& travel) {
  if (!a.holds_for_tool(tool_offset_m) || !b.holds_for_tool(tool_offset_m)) {
    return failure(ErrorCode::NotApplicable,
                   message("comparison for tool offset ", mm_text(tool_offset_m),
                           ": one of the models is not valid for it"));
  }
  std::vector<Vector3> points, difference;
  for (const Vector3& q : axis_positions_m) {
    points.push_back(q + tool_offset_m);
    difference.push_back(a.V_at(q, tool_offset_m, travel) - b.V_at(q, tool_offset_m, travel));
  }
  return rigid_free(points, difference);
}

std::vector<Vector3> tensor_grid(const MachineNodes& nodes) {
  std::vector<Vector3> grid;
  for (const double x : nodes[0].nodes_m) {
    for (const double y : nodes[1].nodes_m) {
      for (const double z : nodes[2].nodes_m) {
        grid.emplace_back(x, y, z);
      }
    }
  }
  return grid;
}

}  // namespace abbe::calib
