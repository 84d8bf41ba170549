#pragma once
/// Residuals of the rows of a run, in row order.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// The residuals y - A U of all rows [m]; y itself for an empty U.
[[nodiscard]] std::vector<double> residuals_m(const Observations&, const Eigen::VectorXd& U);

/// The sum of (residual / sigma)^2 over all rows.
[[nodiscard]] double chi2(const Observations&, std::span<const double> residual_m);

}  // namespace abbe::calib::otf
