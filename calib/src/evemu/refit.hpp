#pragma once
/// The marginal likelihood with columns added to the design, from hyper-parameters that are nearly
/// right.

#include <Eigen/Core>
#include <span>

#include "abbe/calib/evemu/prior.hpp"

namespace abbe::calib::evemu {

/// As most_likely() of bayes-pose, from one start.
[[nodiscard]] Result<HyperParameters> most_likely_near(const HyperParameters& start,
                                                       const ScaledDesign&, std::size_t positions,
                                                       const LinearGaussian& problem,
                                                       std::span<const double> added);

}  // namespace abbe::calib::evemu
