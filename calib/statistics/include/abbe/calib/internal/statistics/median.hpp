#pragma once
/// Median, and the factor that converts a median absolute deviation to a standard deviation.

#include <algorithm>
#include <iterator>
#include <span>

namespace abbe::calib {

/// Ratio of the standard deviation of a normal distribution to its median absolute deviation.
inline constexpr double kMadToSigma = 1.4826;

/// Median; for an even number of values the larger of the two middle values; 0 without values. The
/// order of `values` changes.
[[nodiscard]] inline double median(std::span<double> values) {
  if (values.empty()) {
    return 0.0;
  }
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace abbe::calib
