#include "abbe/calib/internal/evemu/solve/pose_groups.hpp"

#include <Eigen/Core>
#include <cmath>
#include <numeric>
#include <utility>

#include "abbe/calib/evemu/solve/noise.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/evemu/solve/artefact_rows.hpp"
#include "abbe/calib/internal/evemu/solve/design_rows.hpp"

namespace abbe::calib::evemu {
namespace {

/// Covariance of one component of the ball centres of a position, not relative to Ball1: the
/// translation of the pose is free.
Eigen::MatrixXd centre_covariance_m2(const Observations& o, const TouchedArtefact* seen,
                                     std::size_t balls, double s_m) {
  const auto n = static_cast<Eigen::Index>(balls);
  Eigen::MatrixXd C = Eigen::MatrixXd::Identity(n, n);
  if (seen != nullptr && o.slow_noise > 0.0) {
    C += o.slow_noise * o.slow_noise * slow_correlation(*seen);
  }
  return s_m * s_m * C;
}

/// The array placed by its blocks: ideal ball centres of a position.
std::vector<Vector3> placed_m(const Observations& o, const PositionRows& p) {
  std::vector<Vector3> places;
  for (std::size_t i = p.first; i < p.first + p.count; ++i) {
    places.emplace_back(o.rows[i].reading_m + o.rows[i].V_m);
  }
  return places;
}

std::vector<Vector3> corrected_m(const Observations& o, const PositionRows& p,
                                 const PoseGroupOptions& options) {
  std::vector<Vector3> corrected;
  for (std::size_t i = p.first; i < p.first + p.count; ++i) {
    const Vector3& r = o.rows[i].reading_m;
    corrected.emplace_back(options.V_at_m ? Vector3(r + options.V_at_m(r)) : r);
  }
  return corrected;
}

/// Fills y, L and the model's columns of a group.
void fill_pose_group(estimation::ObservationGroup& group, const Observations& o,
                     const PositionRows& p, const RigidTransform& pose,
                     const VolumetricDesign& design) {
  const TouchedArtefact* seen = touched_at(o, p.position);
  const bool has_points = seen != nullptr && seen->ball_points_m.size() == p.count;
  const std::vector<Vector3> places = placed_m(o, p);
  const auto model = static_cast<Eigen::Index>(design.unknowns);
  const Vector3& ball1_m = o.rows[p.ball1].reading_m;

  for (std::size_t b = 0; b < p.count; ++b) {
    const auto row = static_cast<Eigen::Index>(3 * b);
    const Vector3& reading_m = o.rows[p.first + b].reading_m;
    group.y.segment<3>(row) = pose * places[b] - reading_m;
    group.A.block(row, 0, 3, model) =
        has_points ? ball_displacement(*seen, b, design) : design.B(reading_m);
    group.L.block<3, 3>(row, 0).setIdentity();
    group.L.block<3, 3>(row, 3) = rotation_effect(reading_m - ball1_m);
  }
}

}  // namespace

Result<std::vector<estimation::ObservationGroup>> pose_groups(const Observations& o,
                                                              const VolumetricDesign& design,
                                                              const PoseGroupOptions& options) {
  if (!(options.s_m > 0.0) || !std::isfinite(options.s_m)) {
    return failure(ErrorCode::BadInput, message("ball array: standard deviation ", options.s_m,
                                                " m of a ball centre must be positive"));
  }

  const Eigen::MatrixXd of_array = artefact_rows(o);
  std::vector<std::size_t> unknowns(design.unknowns + static_cast<std::size_t>(of_array.cols()));
  std::iota(unknowns.begin(), unknowns.end(), std::size_t{0});
  std::vector<estimation::ObservationGroup> groups;

  for (const PositionRows& p : position_rows(o)) {
    const Result<RigidTransform> pose = fit_rigid(placed_m(o, p), corrected_m(o, p, options));
    if (!pose) {
      return failure(pose.error().code,
                     message("ball array at position ", p.position, ": ", pose.error().text));
    }

    const auto rows = static_cast<Eigen::Index>(3 * p.count);
    estimation::ObservationGroup group{.unknowns = unknowns,
                                       .A = Eigen::MatrixXd::Zero(rows, std::ssize(unknowns)),
                                       .L = Eigen::MatrixXd::Zero(rows, 6),
                                       .u_nuisance = std::vector<double>(6, estimation::kNoPrior),
                                       .y = Eigen::VectorXd::Zero(rows),
                                       .covariance = Eigen::MatrixXd::Zero(rows, rows)};
    fill_pose_group(group, o, p, *pose, design);
    group.A.rightCols(of_array.cols()) =
        of_array.middleRows(static_cast<Eigen::Index>(3 * p.first), rows);

    const Eigen::MatrixXd C =
        centre_covariance_m2(o, touched_at(o, p.position), p.count, options.s_m);
    for (Eigen::Index c = 0; c < 3; ++c) {
      const auto of_component = Eigen::seqN(c, static_cast<Eigen::Index>(p.count), 3);
      group.covariance(of_component, of_component) = C;
    }
    groups.push_back(std::move(group));
  }

  return groups;
}

}  // namespace abbe::calib::evemu
