#pragma once
/// Search for the most likely hyper-parameters of a design with added columns, from a starting
/// point near the solution (the most likely parameters without these columns).

#include <Eigen/Core>
#include <span>

#include "abbe/calib/evemu/prior.hpp"

namespace abbe::calib::evemu {

/// most_likely() for PriorKind::BayesPose, from one starting point.
[[nodiscard]] Result<HyperParameters> most_likely_near(const HyperParameters& start,
                                                       const ScaledDesign&, std::size_t positions,
                                                       const LinearGaussian& problem,
                                                       std::span<const double> added);

}  // namespace abbe::calib::evemu
