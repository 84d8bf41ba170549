#pragma once
/// Expanded uncertainty of a sum of one rectangular and one normal quantity. An instant known to
/// lie between two scans is rectangular: twice its standard uncertainty would cover all of it, not
/// 95 %. Pure.

#include "abbe/protocol/rt.hpp"

namespace abbe::drivers {

/// U with P(|R + N| <= U) = 0.95, R uniform in [-half_width, half_width], N normal with deviation
/// `u_normal`; both >= 0, in the unit of the result. Exact convolution, solved to 1e-9 of its own
/// size. [GUM] G.1.4.
[[nodiscard]] double expanded_95(double half_width, double u_normal) ABBE_RT;

}  // namespace abbe::drivers
