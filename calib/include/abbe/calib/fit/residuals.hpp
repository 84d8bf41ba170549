#pragma once
/// How well points lie on a fitted surface. Any unit of length: the one of the points.

#include <cstddef>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib::fit {

struct ResidualStatistics {
  std::size_t points = 0;
  std::size_t degrees_of_freedom = 0;
  double rms = 0.0;     ///< sqrt(sum r^2 / points)
  double sigma0 = 0.0;  ///< sqrt(sum r^2 / degrees of freedom); 0 without redundancy
  double min = 0.0;     ///< signed: negative lies inside, or behind the normal
  double max = 0.0;
};

/// Of signed residuals r; `unknowns` were fitted to them.
[[nodiscard]] ResidualStatistics residual_statistics(const Eigen::VectorXd& r,
                                                     std::size_t unknowns);

}  // namespace abbe::calib::fit
