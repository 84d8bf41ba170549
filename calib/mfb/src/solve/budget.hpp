#pragma once
/// Parts of the covariance of the 21 errors (Budget in solve.hpp). The estimate is a linear
/// function of the observations and of the prior values; the part of a prior with the standard
/// uncertainty u of an unknown c is (Cov(x, c) / u)^2, what remains is the noise of the touches.
/// All touches have the same noise along their normals. Its variance is divided between `probe` and
/// `machine` in the ratio of their variances.

#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"

namespace abbe::calib::mfb {

[[nodiscard]] std::vector<Budget> budget_of(const Observations&, const WholeSystem&,
                                            const SharedEstimate&, const NuisanceOptions&);

}  // namespace abbe::calib::mfb
