#pragma once
/// Stage one of standstill mode: finds standstills in the stream, assigns them to the positions of
/// the path, and makes three rows per position, along the beam and in two directions across it. The
/// component along the direction of travel is observed, too: the machine stands at a known reading,
/// so that no synchronised clocks are needed. Adjustment, uncertainty and judgement are the same as
/// in on-the-fly mode.
///
/// Uncertainty of component k of the mean of n samples:
///     u_k^2 = s_k^2 c_k / n + creep_k^2 / 12 + u_repeatability^2
/// s_k: standard deviation of a sample. It is the stated one (Noise), multiplied by the median of
/// scatter / stated over all standstills if this median exceeds 1; or the scatter of this
/// standstill if it is significantly larger. c_k: Standstills::correlation, because the mean of n
/// correlated samples is less certain than sigma / sqrt(n). creep_k: creep of this standstill if it
/// is significant, because the place is not known better. Noise that is slower than a standstill
/// appears in the residuals between positions and increases the covariance
/// (Statistics::variance_factor).

#include <vector>

#include "abbe/calib/internal/otf/standstill/standstill_assignment.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// Uncertainties u_k of every standstill, along Standstill::axes_tracker.
[[nodiscard]] std::vector<Vector3> u_of_means_m(const Standstills&, const Noise&,
                                                double u_repeatability_m);

/// Computes the observations; the rows are in the order of the positions. Errors: those of
/// assign_standstills(). Observations::notes name positions without a standstill, standstills
/// without a position, and noise above the stated one.
[[nodiscard]] Result<Observations> observe_standstills(const Standstills&, const Machine&,
                                                       const Path&, const Noise&,
                                                       const Options& = {});

}  // namespace abbe::calib::otf
