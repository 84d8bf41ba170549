#pragma once
/// Scatter of the runs of one error, pooled over its positions; see compare.hpp.

#include <Eigen/Core>
#include <optional>

#include "abbe/calib/direct/compare.hpp"

namespace abbe::calib::direct {

struct Scatter {
  double variance = 0.0;  // variance of one value of one run, in m^2 or rad^2
  std::size_t dof = 0;    // degrees of freedom; 0: the scatter is not known
};
/// The scatter is not known (dof 0) for one run, and if all runs have the same values. For a
/// squareness pass nullopt as motion.
[[nodiscard]] Scatter scatter_of(const Runs&, const std::optional<ErrorMotion>&);

/// Covariance of P mean() from the pooled scatter. It is enlarged at positions with more scatter.
/// The offset of a run does not count as scatter; for a straightness neither does its slope.
[[nodiscard]] Eigen::MatrixXd covariance_of_runs(const Runs&, const std::optional<ErrorMotion>&,
                                                 const Scatter&, const Eigen::MatrixXd& P);

/// True if the uncertainty of the measured values is known: from the scatter, or stated as
/// DeviceUncertainty::u_m or u_rad. An uncertainty of the scale alone is not enough.
[[nodiscard]] bool uncertainty_known(const std::optional<ErrorMotion>&, const Scatter&,
                                     const DeviceUncertainty&);

}  // namespace abbe::calib::direct
