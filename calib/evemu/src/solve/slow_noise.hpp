#pragma once
/// Estimates slow noise relative to the noise of a ball centre, by the marginal likelihood
/// (noise.hpp, prior.hpp).

#include <string>

#include "abbe/calib/evemu/solve/prior.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"

namespace abbe::calib::evemu {

/// Slow noise is included if the logarithm of its likelihood ratio exceeds this limit. In runs that
/// have only white noise, 1 of 40 reaches the limit (twice the logarithm is distributed as chi2
/// with one degree of freedom, and is 0 in half of the runs).
inline constexpr double kLeastSlowNoiseGain = 2.0;

struct SlowNoise {
  double per_s = 0.0;           ///< value for Observations::slow_noise
  double log_likelihood = 0.0;  ///< natural logarithm of the likelihood ratio to no slow noise
};
/// The most likely slow noise, searched from 0.35 to 45 times s (per_s), or 0. `start`:
/// hyper-parameters without slow noise. NotConverged if a comparison fails.
[[nodiscard]] Result<SlowNoise> likely_slow_noise(const Observations&, const ScaledDesign&,
                                                  const HyperParameters& start);

/// Message to the user. `slow_noise_m`: standard deviation per coordinate.
[[nodiscard]] std::string slow_noise_text(double slow_noise_m);

[[nodiscard]] Observations with_slow_noise(const Observations&, double per_s);

}  // namespace abbe::calib::evemu
