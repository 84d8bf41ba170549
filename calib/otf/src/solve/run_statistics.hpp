#pragma once
/// Statistics of the fit of a run.

#include <cstddef>

#include "abbe/calib/otf/solve/residual_noise.hpp"
#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Computes the statistics of the fit of a run. `a` gives rank, datum defect and condition of the
/// adjustment.
[[nodiscard]] Statistics statistics(const Observations&, const Adjustment& a, const Residuals&);

/// Factor for the covariance, from the residuals. Turbulence, vibration, a tracker worse than its
/// data sheet and effects that are not modelled increase the residuals; the stated uncertainty must
/// increase with them. Residuals smaller than the stated noise do not reduce the uncertainty.
[[nodiscard]] double variance_factor(const ResidualNoise&, std::size_t degrees_of_freedom);

/// Mean time from one segment to the next; 1 for segments without times.
[[nodiscard]] double segment_distance(const Observations&);

}  // namespace abbe::calib::otf
