#pragma once
/// The estimate in which the drift of the tracker is an additional unknown (tracker_drift.hpp).

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "abbe/calib/otf/solve/solve.hpp"
#include "nests/drift_estimate.hpp"
#include "solve/whitened_rows.hpp"

namespace abbe::calib::otf {

struct WithDrift {
  RangeOffset offset;  ///< estimated if it has a prior
  TrackerDrift drift;
  Eigen::VectorXd U;
  Eigen::MatrixXd added_covariance;  ///< covariance of U that drift and range offset cause
  std::vector<double> residual_m;    ///< residuals of the rows after subtraction of drift and range
                                     ///< offset
};
/// Computes the variance of the rows relative to the stated variance, from residuals of the
/// original rows of the observations.
using RowVariance = std::function<double(std::span<const double> residual_m)>;
/// Computes the estimate for observations with a drift. `a`: adjustment of `rows`; `residual_m`: y
/// - A U of the original rows. The drift is first estimated with the stated variance, then with the
/// variance of the residuals after subtraction of this drift. NotConverged if `stopped` returns
/// true.
[[nodiscard]] Result<WithDrift> with_drift(const Observations&, const WhitenedRows& rows,
                                           const Adjustment& a, std::span<const double> residual_m,
                                           const RowVariance& variance, const Stopped& stopped);

/// Converts the estimated drift of a run to the form in its solution. `coefficients`: without the
/// range offset.
[[nodiscard]] TrackerDrift tracker_drift(const Observations&, const DriftEstimate&,
                                         Eigen::VectorXd coefficients);
/// True if the random walk is so large that its deviation from straight lines between the knots
/// must be taken into account.
[[nodiscard]] bool notable_walk(const DriftEstimate&);

/// The observations after subtraction of a drift.
[[nodiscard]] Observations without_drift(Observations, const TrackerDrift&);

}  // namespace abbe::calib::otf
