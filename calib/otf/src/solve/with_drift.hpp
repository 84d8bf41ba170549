#pragma once
/// The estimate in which the drift of the tracker is unknown, too (tracker_drift.hpp).

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "abbe/calib/otf/solve/solve.hpp"
#include "nests/drift_estimate.hpp"
#include "solve/whitened_rows.hpp"

namespace abbe::calib::otf {

struct WithDrift {
  RangeOffset offset;  ///< if it has a prior
  TrackerDrift drift;
  Eigen::VectorXd U;
  Eigen::MatrixXd added_covariance;  ///< what drift and range offset add to that of U
  std::vector<double> residual_m;    ///< of the rows without drift and range offset
};
/// Variance of the rows relative to the stated one, from residuals of the observations' own rows.
using RowVariance = std::function<double(std::span<const double> residual_m)>;
/// For observations with a drift. `a`: adjustment of `rows`, `residual_m`: y - A U of the
/// observations' own rows. The drift is first estimated with the stated variance, and then with
/// that of the residuals without it. NotConverged if `stopped` returns true.
[[nodiscard]] Result<WithDrift> with_drift(const Observations&, const WhitenedRows& rows,
                                           const Adjustment& a, std::span<const double> residual_m,
                                           const RowVariance& variance, const Stopped& stopped);

/// The estimate of a run as part of its solution. `coefficients`: without the range offset.
[[nodiscard]] TrackerDrift tracker_drift(const Observations&, const DriftEstimate&,
                                         Eigen::VectorXd coefficients);
/// Whether the random walk is so large that its course between the knots counts.
[[nodiscard]] bool notable_walk(const DriftEstimate&);

/// The observations without a drift.
[[nodiscard]] Observations without_drift(Observations, const TrackerDrift&);

}  // namespace abbe::calib::otf
