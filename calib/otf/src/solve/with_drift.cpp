#include "solve/with_drift.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/result/try.hpp"
#include "solve/drift_columns.hpp"
#include "solve/systematic_effects.hpp"

namespace abbe::calib::otf {
namespace {

/// Mean of the measured positions, tracker frame.
Vector3 centre_tracker_m(const Observations& o) {
  Vector3 sum = Vector3::Zero();
  for (const Observation& row : o.rows) {
    sum += row.axis_position_m / static_cast<double>(o.rows.size());
  }
  const RigidTransform& T = o.alignment.T_machine_tracker;
  return T.R.transpose() * (sum + o.target_offset_m - T.t_m);
}

std::vector<DriftPoint> drift_points(const Observations& o, const DriftBasis& basis,
                                     const Eigen::VectorXd& c) {
  const Vector3 centre_m = centre_tracker_m(o);
  const Matrix3& R = o.alignment.T_machine_tracker.R;
  std::vector<DriftPoint> points;
  for (const double time_s : o.drift->knots_s) {
    points.push_back({time_s, R * basis.dp_dc(time_s, centre_m) * c});
  }
  return points;
}

/// Residuals y - A U - C d of all rows.
std::vector<double> residuals_with_drift_m(const Observations& o, const DriftColumns& columns,
                                           const Eigen::VectorXd& U, const Eigen::VectorXd& d) {
  std::vector<double> r = residuals_m(o, U);
  for (std::size_t i = 0; i < r.size(); ++i) {
    r[i] -= columns.effect_m(o.rows[i], d);
  }
  return r;
}

/// Additional covariance of U because the drift is not straight between its knots. This deviation
/// is not estimated: its coefficients b have the standard deviation of the walk, and change U by
///     dU/db = Q A^T W^2 B - (Q A^T W^2 C) cov(d) (C^T W^2 (1 - A Q A^T W^2) B) / factor
Eigen::MatrixXd covariance_between_knots(const Observations& o, const WhitenedRows& rows,
                                         const Eigen::MatrixXd& cofactor_Q,
                                         std::span<const double> residual_m,
                                         const DriftEstimate& estimate, double factor,
                                         std::size_t offsets) {
  const DriftColumns columns(o, offsets, DriftColumns::BetweenKnots::Walk);
  const AddedColumns::Reduced all = columns.sums(rows, residual_m).reduced(cofactor_Q);
  const Eigen::Index d = estimate.d.size(), b = all.g.size() - d;
  const Eigen::MatrixXd dd_db = estimate.covariance * all.S.topRightCorner(d, b) / factor;
  const Eigen::MatrixXd dU_db = all.dU_dd.rightCols(b) - all.dU_dd.leftCols(d) * dd_db;
  return estimate.walk_m * estimate.walk_m * (dU_db * dU_db.transpose());
}

}  // namespace

TrackerDrift tracker_drift(const Observations& o, const DriftEstimate& estimate,
                           Eigen::VectorXd coefficients) {
  TrackerDrift drift;
  drift.points = drift_points(o, DriftBasis(*o.drift), coefficients);
  drift.coefficients = std::move(coefficients);
  drift.visits = estimate.visits;
  drift.u_repeatability_m = estimate.u_repeatability_m;
  drift.walk_m = estimate.walk_m;
  drift.notes = estimate.notes;
  return drift;
}

bool notable_walk(const DriftEstimate& estimate) {
  constexpr double kNegligibleWalk_m = 50e-9;
  return estimate.walk_m > kNegligibleWalk_m;
}

Observations without_drift(Observations o, const TrackerDrift& drift) {
  if (!o.drift) {
    return o;
  }
  const DriftColumns columns(o);
  for (Observation& row : o.rows) {
    row.y_m -= columns.effect_m(row, drift.coefficients);
  }
  return o;
}

Observations without_run_effects(Observations o, const Solution& solution) {
  o = without_range_offset(std::move(o), solution.range_offset.value_m);
  if (solution.two_axes) {
    o = without_two_axis_errors(std::move(o), *solution.two_axes);
  }
  return solution.drift ? without_drift(std::move(o), *solution.drift) : o;
}

Vector3 TrackerDrift::largest_m() const {
  Vector3 most = Vector3::Zero();
  for (const DriftPoint& point : points) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (std::abs(point.value_m(k)) > std::abs(most(k))) {
        most(k) = point.value_m(k);
      }
    }
  }
  return most;
}

Result<WithDrift> with_drift(const Observations& o, const WhitenedRows& rows, const Adjustment& a,
                             std::span<const double> residual_m, const RowVariance& variance,
                             const Stopped& stopped) {
  constexpr int kRounds = 3;
  DriftEquations equations{.u_range_offset_m = o.u_range_offset_m};
  const Eigen::Index offsets = equations.offsets();
  const DriftColumns columns(o, static_cast<std::size_t>(offsets));
  const AddedColumns::Reduced reduced = columns.sums(rows, residual_m).reduced(a.cofactor_Q);

  WithDrift with;
  DriftEstimate estimate;
  double factor = 1.0, factor_used = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    factor_used = factor;
    equations.S = reduced.S / factor;
    equations.g = reduced.g / factor;
    Result<DriftEstimate> found = estimate_drift(*o.drift, equations, stopped);
    ABBE_TRY(found);
    estimate = *std::move(found);
    with.U = a.U - reduced.dU_dd * estimate.d;
    with.residual_m = residuals_with_drift_m(o, columns, with.U, estimate.d);
    factor = std::max(1.0, variance(with.residual_m));
  }

  if (offsets > 0) {
    with.offset = {estimate.d(0), std::sqrt(std::max(0.0, estimate.covariance(0, 0)))};
  }
  with.drift = tracker_drift(o, estimate, estimate.d.tail(estimate.d.size() - offsets));
  Eigen::MatrixXd added = reduced.dU_dd * estimate.covariance * reduced.dU_dd.transpose();
  if (notable_walk(estimate)) {
    added += covariance_between_knots(o, rows, a.cofactor_Q, residual_m, estimate, factor_used,
                                      static_cast<std::size_t>(offsets));
  }
  with.added_covariance = 0.5 * (added + added.transpose());  // removes the asymmetry by rounding
  return with;
}

}  // namespace abbe::calib::otf
