#pragma once
/// Search for the most likely hyper-parameters (prior.hpp) from a given starting point.

#include <Eigen/Core>
#include <span>

#include "abbe/calib/evemu/solve/prior.hpp"

namespace abbe::calib::evemu {

/// Hyper-parameters of the largest marginal likelihood with columns added to the design. As
/// most_likely() for bayes-pose, but searched from one starting point near the solution.
[[nodiscard]] Result<HyperParameters> most_likely_near(const HyperParameters& start,
                                                       const ScaledDesign&, std::size_t positions,
                                                       const LinearGaussian& problem,
                                                       std::span<const double> added);

}  // namespace abbe::calib::evemu
