#pragma once
/// Residuals of points to a fitted surface. The unit of length is that of the points.

#include <cstddef>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::fit {

struct ResidualStatistics {
  std::size_t points = 0;
  std::size_t degrees_of_freedom = 0;
  double rms = 0.0;     ///< sqrt(sum r^2 / points)
  double sigma0 = 0.0;  ///< sqrt(sum r^2 / degrees of freedom); 0 without redundancy
  double min = 0.0;     ///< negative: point inside the sphere, or on the side opposite the normal
  double max = 0.0;
};

/// Statistics of the signed residuals r of a fit with `unknowns` unknowns.
[[nodiscard]] ResidualStatistics residual_statistics(const Eigen::VectorXd& r,
                                                     std::size_t unknowns);

}  // namespace abbe::calib::fit
