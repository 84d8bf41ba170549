#pragma once
/// The drift of the tracker in each of several runs that have common tables (tracker_drift.hpp).
/// Every run has a course, an amplitude and a repeatability of its own. The rows connect the
/// drifts d_k of the runs through U:
///     S d = g,   S, g: reduced normal equations of all drifts and of the range offset of each run
/// Run by run, estimate_drift() gives mean m and covariance V of d_k from the rows, with what is
/// known about the other drifts (visits and prior: information P, P c):
///     S_kk - S_kr (S_rr + P_rr)^-1 S_rk,   g_k - S_kr (S_rr + P_rr)^-1 (g_r + P_r c_r)
/// and so what visits and prior of run k tell: P_k = V^-1 - S_kk.., P_k c_k = V^-1 m - g_k.. (after
/// [Minka 2001], expectation propagation). After some sweeps
///     d = (S + P)^-1 (g + P c),   cov d = (S + P)^-1.

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

struct DriftOfRuns {
  std::vector<RangeOffset> offset;                 ///< by run; 0 without a prior
  std::vector<std::optional<TrackerDrift>> drift;  ///< by run; none without visits
  Eigen::VectorXd U;
  Eigen::MatrixXd added_covariance;  ///< what drifts and range offsets add to that of U
  /// By run: y - A U without drift and range offset.
  std::vector<std::vector<double>> residual_m;
};

/// Variance of the rows of all runs relative to the stated one, from their residuals.
using VarianceOfRuns = std::function<double(const std::vector<std::vector<double>>& residual_m)>;

/// For runs of which at least one has a drift. `a`: their adjustment without a drift, `residual_m`:
/// y - A U by run. NotConverged if `stopped` returns true; other errors are those of
/// estimate_drift().
[[nodiscard]] Result<DriftOfRuns> drift_of_runs(std::span<const Observations>, const Adjustment& a,
                                                const std::vector<std::vector<double>>& residual_m,
                                                const VarianceOfRuns& variance,
                                                const Stopped& stopped);

[[nodiscard]] inline bool any_drift(std::span<const Observations> runs) {
  for (const Observations& o : runs) {
    if (o.drift) {
      return true;
    }
  }
  return false;
}

}  // namespace abbe::calib::otf
