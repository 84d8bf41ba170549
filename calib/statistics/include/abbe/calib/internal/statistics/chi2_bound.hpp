#pragma once

#include <cmath>

namespace abbe::calib {

/// Upper bound of the quantile of the chi-square distribution with k degrees of freedom for the
/// probability 1 - e^-x [Laurent 2000].
[[nodiscard]] inline double chi2_bound(double k, double x) {
  return k + 2.0 * std::sqrt(k * x) + 2.0 * x;
}

}  // namespace abbe::calib
