#pragma once
/// The drift of the tracker in each of several runs that have common tables (tracker_drift.hpp).
/// Every run has its own course, amplitude and repeatability. The drifts d_k of the runs are
/// connected by the rows through U:
///     S d = g,   S, g: reduced normal equations of all drifts and of the range offset of each run
/// For one run after another, estimate_drift() computes mean m and covariance V of d_k from the
/// rows and from the information P, P c of visits and priors about the other drifts:
///     S_kk - S_kr (S_rr + P_rr)^-1 S_rk,   g_k - S_kr (S_rr + P_rr)^-1 (g_r + P_r c_r)
/// This gives the information of visits and prior of run k: P_k = V^-1 - S_kk.., P_k c_k = V^-1 m -
/// g_k.. (expectation propagation, after [Minka 2001]). After some sweeps over all runs
///     d = (S + P)^-1 (g + P c),   cov d = (S + P)^-1.

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

struct DriftOfRuns {
  std::vector<RangeOffset> offset;                 ///< by run; 0 if the offset has no prior
  std::vector<std::optional<TrackerDrift>> drift;  ///< by run; nullopt without visits
  Eigen::VectorXd U;
  Eigen::MatrixXd added_covariance;  ///< covariance of U that is caused by drifts and range offsets
  /// Residuals by run: y - A U, after subtraction of drift and range offset.
  std::vector<std::vector<double>> residual_m;
};

/// Variance of the rows of all runs relative to the stated one, from their residuals.
using VarianceOfRuns = std::function<double(const std::vector<std::vector<double>>& residual_m)>;

/// Estimates the drifts of runs of which at least one has a drift. `a`: their adjustment without a
/// drift, `residual_m`: y - A U by run. NotConverged if `stopped` returns true; other errors are
/// those of estimate_drift().
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
