#pragma once

#include <cstddef>

namespace abbe::calib {

/// Natural logarithm of the probability that chi-square with k >= 1 degrees of freedom exceeds x.
/// It is the logarithm of the incomplete gamma function Q(k/2, x/2), computed by its series or its
/// continued fraction ([Press 2007] section 6.2). 0 for x <= 0, minus infinity for an infinite x,
/// NaN for NaN. Relative error: 1e-12 of the probability and 1e-12 of the logarithm. The same bits
/// on every processor.
[[nodiscard]] double log_chi2_tail(double x, std::size_t k) noexcept;

}  // namespace abbe::calib
