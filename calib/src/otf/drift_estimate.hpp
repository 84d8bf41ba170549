#pragma once
/// Estimate of the drift of the tracker from the reduced normal equations of the rows of a run, the
/// visits of nests and the prior (tracker_drift.hpp).

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "otf/nest_information.hpp"

namespace abbe::calib::otf {

/// S d = g of the rows; d: range offset (only if it has a prior), then the coefficients.
struct DriftEquations {
  Eigen::MatrixXd S{};
  Eigen::VectorXd g{};
  double u_range_offset_m = 0.0;  ///< 0: the range offset is not an unknown

  [[nodiscard]] Eigen::Index offsets() const { return u_range_offset_m > 0.0 ? 1 : 0; }
};

struct DriftEstimate {
  Eigen::VectorXd d;
  Eigen::MatrixXd covariance;
  double u_repeatability_m = 0.0;    ///< rms over the factors of the stated one
  std::size_t visits = 0;            ///< of positions that were visited at least twice
  std::vector<std::string> notes{};  ///< nests that moved, visits not used
};
[[nodiscard]] DriftEstimate estimate_drift(const DriftObservations&, const DriftEquations&);

}  // namespace abbe::calib::otf
