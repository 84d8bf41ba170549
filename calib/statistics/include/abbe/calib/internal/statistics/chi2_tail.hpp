#pragma once

#include <cstddef>

namespace abbe::calib {

/// Natural logarithm of the probability that chi-square with k >= 1 degrees of freedom exceeds x:
/// of the incomplete gamma function Q(k/2, x/2), by its series or its continued fraction ([Press
/// 2007] section 6.2). 0 for x <= 0, minus infinity for an infinite x, NaN for NaN. Error: 1e-12 of
/// the probability, in the logarithm 1e-12 of its value. The same bits on every processor.
[[nodiscard]] double log_chi2_tail(double x, std::size_t k) noexcept;

}  // namespace abbe::calib
