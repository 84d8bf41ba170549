#pragma once
/// Limits that a correct measurement exceeds with a probability of 0.1 %.

#include <cmath>

namespace abbe::calib {

/// 99.9 % quantile of the normal distribution, one-sided.
inline constexpr double kNormal999 = 3.0902323;

/// 99.9 % quantile of chi-square / dof with dof >= 1 degrees of freedom, by [Wilson 1931]: 2 % too
/// large at 3 degrees of freedom, more accurate above.
[[nodiscard]] inline double chi2_per_dof_999(double dof) {
  const double s = 2.0 / (9.0 * dof);
  const double root = 1.0 - s + kNormal999 * std::sqrt(s);
  return root * root * root;
}

}  // namespace abbe::calib
