#pragma once
/// The same bits on every processor, where std::hypot is free to differ.

#include <cmath>

namespace abbe::calib {

/// sqrt(a^2 + b^2): the combined standard uncertainty of two independent parts (GUM 5.1.2). Does
/// not scale its arguments: for values between 1e-150 and 1e150, and zero.
[[nodiscard]] inline double root_sum_of_squares(double a, double b) noexcept {
  return std::sqrt(a * a + b * b);
}

}  // namespace abbe::calib
