#include "otf/with_drift.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "otf/added_columns.hpp"
#include "otf/drift_estimate.hpp"
#include "otf/row_residuals.hpp"

namespace abbe::calib::otf {
namespace {

/// Values of the added columns in all rows of the observations: one column per row.
Eigen::MatrixXd added_values(const Observations& o, const DriftBasis& basis, Eigen::Index offsets) {
  const auto size = static_cast<Eigen::Index>(basis.size());
  Eigen::MatrixXd values(offsets + size, std::ssize(o.rows));
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    double* const column = values.col(static_cast<Eigen::Index>(i)).data();
    if (offsets > 0) {
      *column = drow_drange_offset(o, o.rows[i]);
    }
    drow_ddrift(o, basis, o.rows[i], std::span(column + offsets, basis.size()));
  }
  return values;
}

AddedColumns sums_of(const Observations& o, const WhitenedRows& rows, const Eigen::MatrixXd& values,
                     std::span<const double> residual_m) {
  AddedColumns sums(static_cast<std::size_t>(values.rows()), o.unknowns());
  Eigen::VectorXd whitened(values.rows());
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    for (Eigen::Index k = 0; k < values.rows(); ++k) {
      whitened(k) =
          rows.value(i, [&](std::size_t row) { return values(k, static_cast<Eigen::Index>(row)); });
    }
    const double r_m = rows.value(i, [&](std::size_t row) { return residual_m[row]; });
    sums.add(o.rows[i], rows.row(i), r_m,
             std::span(whitened.data(), static_cast<std::size_t>(whitened.size())));
  }
  return sums;
}

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

Observations without_coefficients(Observations o, const Eigen::VectorXd& c) {
  const DriftBasis basis(*o.drift);
  std::vector<double> values(basis.size());
  const Eigen::Map<const Eigen::VectorXd> of_row(values.data(), std::ssize(values));
  for (Observation& row : o.rows) {
    drow_ddrift(o, basis, row, values);
    row.y_m -= of_row.dot(c);
  }
  return o;
}

}  // namespace

Observations without_drift(Observations o, const TrackerDrift& drift) {
  return o.drift ? without_coefficients(std::move(o), drift.coefficients) : o;
}

Observations without_run_effects(Observations o, const Solution& solution) {
  o = without_range_offset(std::move(o), solution.range_offset.value_m);
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

WithDrift with_drift(const Observations& o, const WhitenedRows& rows, const Adjustment& a,
                     std::span<const double> residual_m,
                     const std::function<double(std::span<const double>)>& variance) {
  constexpr int kRounds = 3;
  const DriftBasis basis(*o.drift);
  DriftEquations equations{.u_range_offset_m = o.u_range_offset_m};
  const Eigen::Index offsets = equations.offsets();
  const Eigen::MatrixXd values = added_values(o, basis, offsets);
  const AddedColumns::Reduced reduced = sums_of(o, rows, values, residual_m).reduced(a.cofactor_Q);

  WithDrift with;
  DriftEstimate estimate;
  double factor = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    equations.S = reduced.S / factor;
    equations.g = reduced.g / factor;
    estimate = estimate_drift(*o.drift, equations);
    with.U = a.U - reduced.dU_dd * estimate.d;
    if (offsets > 0) {
      with.offset = {estimate.d(0), std::sqrt(std::max(0.0, estimate.covariance(0, 0)))};
    }
    with.drift.coefficients = estimate.d.tail(estimate.d.size() - offsets);
    with.residual_m = residuals_m(
        without_drift(without_range_offset(o, with.offset.value_m), with.drift), with.U);
    factor = std::max(1.0, variance(with.residual_m));
  }

  with.drift.points = drift_points(o, basis, with.drift.coefficients);
  with.drift.visits = estimate.visits;
  with.drift.u_repeatability_m = estimate.u_repeatability_m;
  with.drift.notes = std::move(estimate.notes);
  with.added_covariance = reduced.dU_dd * estimate.covariance * reduced.dU_dd.transpose();
  return with;
}

}  // namespace abbe::calib::otf
