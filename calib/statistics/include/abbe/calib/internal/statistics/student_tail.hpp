#pragma once

#include <cstddef>

namespace abbe::calib {

/// Probability that a variable with Student's distribution of `dof` >= 1 degrees of freedom exceeds
/// |t| in absolute value. It is the incomplete beta function I_x(dof/2, 1/2) with x = dof / (dof +
/// t^2), computed by its continued fraction ([Press 2007] section 6.4). 1 for t = 0, NaN for NaN.
/// Error: 1e-12 of the probability. More than 10,000 degrees of freedom count as 10,000. The same
/// bits on every processor.
[[nodiscard]] double student_tail(double t, std::size_t dof) noexcept;

/// Two-sided quantile: the t >= 0 with student_tail(t, dof) = p, 0 < p <= 1, with a relative error
/// of 1e-10.
[[nodiscard]] double student_quantile(double p, std::size_t dof) noexcept;

/// Student's t for 95 % divided by the quantile of the normal distribution: [GUM] table G.2, and
/// from 6 degrees of freedom the Cornish-Fisher series, accurate to 0.1 %. dof >= 1.
[[nodiscard]] double student_over_normal(double dof) noexcept;

}  // namespace abbe::calib
