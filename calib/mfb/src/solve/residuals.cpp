#include "solve/residuals.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "solve/triangle.hpp"

namespace abbe::calib::mfb {
namespace {

/// The pose that results from the estimated displacement and rotation about the middle of the bar.
BarPose corrected_pose(const PositionOfBar& position, const Eigen::VectorXd& c) {
  const Vector3 moved_m = c.head<3>(), turned_rad = c.segment<3>(3);
  const Vector3 middle_m = 0.5 * position.O_N_m;
  BarPose pose;
  pose.origin_m =
      position.pose.origin_m + position.pose.axes * (moved_m - turned_rad.cross(middle_m));
  const double angle_rad = turned_rad.norm();
  pose.axes = position.pose.axes;
  if (angle_rad > 0.0) {
    pose.axes *= Eigen::AngleAxisd(angle_rad, Vector3(turned_rad / angle_rad)).toRotationMatrix();
  }
  return pose;
}

std::vector<Vector3> points_in_rows(const Eigen::VectorXd& rows) {
  std::vector<Vector3> points;
  for (Eigen::Index i = 0; i + 2 < rows.size(); i += 3) {
    points.emplace_back(rows.segment<3>(i));
  }
  return points;
}

PassResiduals residuals_of_pass(const Eigen::VectorXd& whitened, const Eigen::VectorXd& before,
                                const RootOfNoise& root) {
  PassResiduals pass;
  pass.chi2 = whitened.squaredNorm();
  pass.O_m = points_in_rows(root.matrixL() * whitened);
  pass.before_m = points_in_rows(root.matrixL() * before);
  const Eigen::MatrixXd covariance = root.reconstructedMatrix();
  for (std::size_t i = 0; i < pass.O_m.size(); ++i) {
    const auto at = 3 * static_cast<Eigen::Index>(i);
    const Matrix3 of_hole = covariance.block<3, 3>(at, at);
    pass.u_O_m.emplace_back(of_hole.diagonal().cwiseSqrt());
    pass.hole_chi2.push_back(pass.O_m[i].dot(of_hole.ldlt().solve(pass.O_m[i])));
  }
  return pass;
}

/// Adds the estimated drifts, which are reported along the machine axes; the unknown rates and
/// constants are along the bar axes.
void append_drift(Solution& solution, const Observations& o, const PositionSystem& s,
                  const SharedEstimate& estimate, const Eigen::VectorXd& c) {
  for (const std::size_t second : s.passes) {
    const PassObservation& pass = o.passes[second];
    if (!pass.second_of_pair || s.layout.rates == s.layout.pairs) {
      continue;
    }
    const Eigen::Index first = s.layout.pairs + 6 * static_cast<Eigen::Index>(*pass.pair);
    PairDrift drift;
    for (const std::size_t other : s.passes) {
      if (o.passes[other].pair == pass.pair && other != second) {
        drift.forward = o.plan.measurements[o.passes[other].measurement].name;
      }
    }
    drift.backward = o.plan.measurements[pass.measurement].name;
    const Matrix3& axes = o.positions[pass.position].pose.axes;
    drift.rate_m = axes * c.segment<3>(first);
    drift.step_m = axes * c.segment<3>(first + 3);
    Vector3 u_m;
    for (Eigen::Index k = 0; k < 3; ++k) {
      u_m(k) = nuisance_uncertainty(s, estimate, first + k);
    }
    drift.u_rate_m = (axes.cwiseAbs2() * u_m.cwiseAbs2()).cwiseSqrt();
    solution.drift.push_back(std::move(drift));
  }
}

}  // namespace

NuisanceRow nuisance_row(const PositionSystem& s, Eigen::Index k) {
  NuisanceRow row;
  row.own =
      s.R.transpose().triangularView<Eigen::Lower>().solve(Eigen::VectorXd::Unit(s.R.rows(), k));
  row.shared = s.G.transpose() * row.own;
  return row;
}

double nuisance_uncertainty(const PositionSystem& s, const SharedEstimate& estimate,
                            Eigen::Index k) {
  const NuisanceRow row = nuisance_row(s, k);
  return std::sqrt(row.own.squaredNorm() + row.shared.dot(estimate.covariance * row.shared));
}

Eigen::VectorXd covariance_with_nuisance(const PositionSystem& s, const SharedEstimate& estimate,
                                         Eigen::Index k) {
  return -(estimate.covariance * nuisance_row(s, k).shared);
}

void set_degrees_of_freedom(Solution& solution, const WholeSystem& system,
                            const SharedEstimate& estimate) {
  for (const PositionSystem& s : system.positions) {
    const Eigen::MatrixXd Q =
        s.R.transpose().triangularView<Eigen::Lower>().solve(s.L.transpose()).transpose();
    const RowMajorRows P = s.A - Q * s.G;
    const RowMajorRows shares = times_upper(P, estimate.root);
    for (std::size_t k = 0; k < s.passes.size(); ++k) {
      const Eigen::Index first = s.rows_of_pass * static_cast<Eigen::Index>(k);
      solution.residuals[s.passes[k]].degrees_of_freedom =
          static_cast<double>(s.rows_of_pass) - Q.middleRows(first, s.rows_of_pass).squaredNorm() -
          shares.middleRows(first, s.rows_of_pass).squaredNorm();
    }
  }
}

void set_residuals(Solution& solution, const Observations& o, const WholeSystem& system,
                   const SharedEstimate& estimate) {
  solution.residuals.resize(o.passes.size());
  for (const PositionSystem& s : system.positions) {
    const Eigen::VectorXd c = s.nuisances(estimate.x);
    const Eigen::VectorXd r = s.y - s.A * estimate.x - s.L * c;
    const Eigen::VectorXd no_errors =
        s.y - s.L * s.nuisances(Eigen::VectorXd::Zero(estimate.x.size()));
    for (std::size_t k = 0; k < s.passes.size(); ++k) {
      const Eigen::Index first = s.rows_of_pass * static_cast<Eigen::Index>(k);
      PassResiduals& pass = solution.residuals[s.passes[k]];
      pass = residuals_of_pass(r.segment(first, s.rows_of_pass),
                               no_errors.segment(first, s.rows_of_pass), s.root[k]);
      pass.measurement = o.plan.measurements[o.passes[s.passes[k]].measurement].name;
    }
    solution.poses.push_back(corrected_pose(o.positions[o.passes[s.passes.front()].position], c));
    append_drift(solution, o, s, estimate, c);
  }
}

}  // namespace abbe::calib::mfb
