#pragma once
/// Median, and the standard deviation that follows from a median of absolute deviations.

#include <algorithm>
#include <iterator>
#include <span>

namespace abbe::calib {

/// Standard deviation of a normal distribution, divided by its median absolute deviation.
inline constexpr double kMadToSigma = 1.4826;

/// Middle value, of an even number the larger of the two in the middle; 0 without values. The order
/// of `values` changes.
[[nodiscard]] inline double median(std::span<double> values) {
  if (values.empty()) {
    return 0.0;
  }
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace abbe::calib
