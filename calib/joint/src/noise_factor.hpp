#pragma once
/// Upper limit of a noise variance that was estimated (joint/identify.hpp).

#include <algorithm>
#include <cmath>

namespace abbe::calib::joint {

/// The factor by which the variance of the noise exceeds its estimate with a probability of 2 %:
/// dof divided by the 2 % quantile of chi-square with dof degrees of freedom, in the approximation
/// of [Wilson 1931], which is wrong for a dof of 1 or 2: the factor is at most 1000. 1 for a noise
/// that was stated (dof 0).
[[nodiscard]] inline double variance_may_be(double dof) {
  if (!(dof > 0.0)) {
    return 1.0;
  }
  constexpr double kNormalQuantile = 2.054;  // exceeded with a probability of 2 %
  constexpr double kLeastRoot = 0.1;
  const double s = 2.0 / (9.0 * dof);
  const double root = std::max(1.0 - s - kNormalQuantile * std::sqrt(s), kLeastRoot);
  return 1.0 / (root * root * root);
}

}  // namespace abbe::calib::joint
