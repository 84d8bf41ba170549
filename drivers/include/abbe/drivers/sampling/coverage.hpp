#pragma once
/// Expanded uncertainty of the sum of one rectangular and one normal quantity. An instant known to
/// lie between two scans has a rectangular distribution: two standard uncertainties would cover
/// 100 % of it, not 95 %. Pure.

#include "abbe/protocol/rt.hpp"

namespace abbe::drivers {

/// Returns the U for which
///     P(|R + N| <= U) = 0.95
/// where R is uniform in [-half_width, half_width] and N is normal with standard deviation
/// `u_normal`. Both arguments >= 0, in the unit of the result. Exact convolution, solved to a
/// relative 1e-9. [GUM] G.1.4.
[[nodiscard]] double expanded_95(double half_width, double u_normal) ABBE_RT;

}  // namespace abbe::drivers
