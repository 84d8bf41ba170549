#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/result/try.hpp"
#include "error_functions.hpp"

namespace abbe::calib::iso {
namespace {

std::vector<Vector3> lattice_of(const LineBox& box, int per_side) {
  std::vector<Vector3> points_m;
  const Vector3 step_m = (box.high_m - box.low_m) / (per_side - 1.0);
  for (int x = 0; x < per_side; ++x) {
    for (int y = 0; y < per_side; ++y) {
      for (int z = 0; z < per_side; ++z) {
        points_m.push_back(box.low_m + step_m.cwiseProduct(Vector3(x, y, z)));
      }
    }
  }
  return points_m;
}

/// An axis position and the V at this position.
struct VAtPoint {
  Vector3 q_m = Vector3::Zero(), V_m = Vector3::Zero();
};

/// Standard uncertainty of the largest |V|. It combines `u_m`, the uncertainty of V at this point
/// along V, with the contribution of other points (u_of()). A coarse lattice and the point itself
/// are enough, because neighbouring points of a fine lattice have the same errors.
double u_of_largest(const ErrorFunctions& functions, const LineBox& box, const VAtPoint& largest,
                    double u_m) {
  constexpr int kPerSide = 5;
  std::vector<Vector3> points_m = lattice_of(box, kPerSide);
  points_m.push_back(largest.q_m);
  Eigen::VectorXd V_m(3 * std::ssize(points_m));
  Eigen::MatrixXd errors_m(V_m.size(), functions.drawn_errors().cols());
  Eigen::Index i = 0;
  for (const Vector3& q_m : points_m) {
    for (const Axis axis : kAllAxes) {
      const auto component = static_cast<Eigen::Index>(index(axis));
      const Eigen::RowVectorXd row = functions.row(q_m, Vector3::Unit(component));
      V_m(i) = functions.value(row);
      errors_m.row(i++) = row * functions.drawn_errors();
    }
  }

  const double size_m = largest.V_m.norm();
  const Eigen::RowVectorXd along =
      size_m > 0.0 ? Eigen::RowVectorXd(largest.V_m.transpose() / size_m * errors_m.bottomRows<3>())
                   : Eigen::RowVectorXd::Zero(errors_m.cols());
  return u_of(u_m, V_m, errors_m, along, [](const Eigen::VectorXd& all_m) {
    return std::sqrt(all_m.reshaped(3, all_m.size() / 3).colwise().squaredNorm().maxCoeff());
  });
}

/// Mean and maximum of U(V) over a lattice, after removal of the best-fit rigid motion.
struct UOfShape {
  double mean_m = 0.0, max_m = 0.0;
};
UOfShape u_of_shape(const ErrorFunctions& functions, const LineBox& box, const Vector3& tool_m) {
  constexpr int kPerSide = 6;
  const std::vector<Vector3> lattice_m = lattice_of(box, kPerSide);
  const Eigen::Index n = std::ssize(lattice_m);
  Eigen::MatrixXd rows(3 * n, functions.drawn_errors().rows()), rigid(3 * n, 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vector3& q_m = lattice_m[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < 3; ++k) {
      rows.row(3 * i + k) = functions.row(q_m, Vector3::Unit(k));
    }
    rigid.block<3, 3>(3 * i, 0).setIdentity();
    rigid.block<3, 3>(3 * i, 3) = rotation_effect(q_m + tool_m);
  }
  const Eigen::MatrixXd motions =
      rigid.householderQr().householderQ() * Eigen::MatrixXd::Identity(3 * n, 6);
  rows -= motions * (motions.transpose() * rows);

  const Eigen::VectorXd variance_m2 = functions.variances(rows);
  UOfShape u;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double U_m = 2.0 * std::sqrt(std::max(0.0, variance_m2.segment<3>(3 * i).sum()));
    u.mean_m += U_m / static_cast<double>(n);
    u.max_m = std::max(u.max_m, U_m);
  }
  return u;
}

}  // namespace

Result<VolumeError> volume_error(const VolumetricModel& model) {
  const Result<LineBox> box = line_box(model.validity());
  ABBE_TRY(box);

  constexpr int kPerSide = 11;
  const Vector3 tool_m = model.tool_offsets_m().front();
  const std::vector<Vector3> lattice_m = lattice_of(*box, kPerSide);
  VolumeError e{.points = lattice_m.size()};
  std::vector<Vector3> points_m, V_m;
  VAtPoint largest{lattice_m.front(), Vector3::Zero()};
  for (const Vector3& q_m : lattice_m) {
    const VolumetricError at = model.error_at(q_m, tool_m, AxisTravel{});
    points_m.push_back(q_m + tool_m);
    V_m.push_back(at.V_m);
    const double U_m = 2.0 * std::sqrt(std::max(0.0, at.cov_V_m2.trace()));
    e.mean_U_m += U_m / static_cast<double>(lattice_m.size());
    e.max_U_m = std::max(e.max_U_m, U_m);
    const double size_m = at.V_m.norm();
    if (size_m > e.largest.value) {
      const Vector3 along = at.V_m / size_m;
      e.largest = {size_m, std::sqrt(std::max(0.0, along.dot(at.cov_V_m2 * along)))};
      largest = {q_m, at.V_m};
    }
  }

  const ErrorFunctions functions(model);
  e.largest.u = u_of_largest(functions, *box, largest, e.largest.u);
  const UOfShape of_shape = u_of_shape(functions, *box, tool_m);
  e.rigid_free_mean_U_m = of_shape.mean_m;
  e.rigid_free_max_U_m = of_shape.max_m;
  const Result<ModelDifference> statistics = rigid_free(points_m, V_m);
  ABBE_TRY(statistics);
  e.mean_m = statistics->as_stated.mean_m;
  e.rms_m = statistics->as_stated.rms_m;
  e.rigid_free_mean_m = statistics->rigid_free.mean_m;
  e.rigid_free_rms_m = statistics->rigid_free.rms_m;
  e.rigid_free_max_m = statistics->rigid_free.max_m;
  return e;
}

}  // namespace abbe::calib::iso
