#pragma once
/// Stage one of standstill mode: standstills in the stream, their assignment to the positions of
/// the path, and three rows per position, along the beam and in two directions across it. The
/// component along the direction of travel is observed, too, because the machine stands at a known
/// reading: no clock is involved. Adjustment, uncertainty and judgement are those of the on-the-fly
/// method.
///
/// Uncertainty of component k of the mean of n samples:
///     u_k^2 = s_k^2 c_k / n + creep_k^2 / 12 + u_repeatability^2
/// s_k: standard deviation of a sample. It is the stated one (Noise), multiplied by the median over
/// all standstills of scatter / stated if that exceeds 1, and the scatter of this standstill where
/// that is significantly larger. c_k: Standstills::correlation; n correlated samples do not give
/// sigma / sqrt(n). creep_k: of this standstill, if it is significant: its place is known to the
/// creep. Noise that is slower than a standstill is in the residuals between positions and widens
/// the covariance (Statistics::variance_factor).

#include <vector>

#include "abbe/calib/internal/otf/standstill/standstill_assignment.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// u_k of every standstill, along Standstill::axes_tracker.
[[nodiscard]] std::vector<Vector3> u_of_means_m(const Standstills&, const Noise&,
                                                double u_repeatability_m);

/// Errors: those of assign_standstills(). Positions without a standstill, standstills without a
/// position, and noise above the stated one are in Observations::notes. The rows are in the order
/// of the positions.
[[nodiscard]] Result<Observations> observe_standstills(const Standstills&, const Machine&,
                                                       const Path&, const Noise&,
                                                       const Options& = {});

}  // namespace abbe::calib::otf
