#pragma once
/// Estimate of the drift of the tracker from the reduced normal equations of the rows of a run, the
/// visits of nests and the prior (tracker_drift.hpp).

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "nests/drift_likelihood.hpp"

namespace abbe::calib::otf {

struct DriftEstimate {
  Eigen::VectorXd d;
  Eigen::MatrixXd covariance;
  double u_repeatability_m = 0.0;    ///< rms over the factors of the stated one
  double walk_m = 0.0;               ///< rms of the standard deviation of the random walk
  std::size_t visits = 0;            ///< of positions that were visited at least twice
  std::vector<std::string> notes{};  ///< nests that moved, visits not used
};
/// NotConverged if `stopped` returns true.
[[nodiscard]] Result<DriftEstimate> estimate_drift(const DriftObservations&, const DriftEquations&,
                                                   const Stopped& stopped);

}  // namespace abbe::calib::otf
