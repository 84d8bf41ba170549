#pragma once
/// Estimates the drift of the tracker from the reduced normal equations of the rows of a run, the
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
  double u_repeatability_m = 0.0;    ///< used repeatability: rms over the factors of the stated one
  double walk_m = 0.0;               ///< standard deviation of the random walk, rms over the
                                     ///< courses
  std::size_t visits = 0;            ///< number of visits of positions that were visited at least
                                     ///< twice
  std::vector<std::string> notes{};  ///< nests that moved, and visits that are not used
};
/// Computes the estimate. NotConverged if `stopped` returns true.
[[nodiscard]] Result<DriftEstimate> estimate_drift(const DriftObservations&, const DriftEquations&,
                                                   const Stopped& stopped);

}  // namespace abbe::calib::otf
