#pragma once
/// Root sum of squares with bit-identical results on every processor.

#include <cmath>

namespace abbe::calib {

/// sqrt(a^2 + b^2), for example the combined standard uncertainty of two independent components
/// (GUM 5.1.2). The result has the same bits on every processor, which std::hypot does not
/// guarantee. The arguments are not scaled: each must be 0 or between 1e-150 and 1e150, else the
/// squares overflow or underflow.
[[nodiscard]] inline double root_sum_of_squares(double a, double b) noexcept {
  return std::sqrt(a * a + b * b);
}

}  // namespace abbe::calib
