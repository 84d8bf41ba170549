#pragma once
/// How large slow noise is beside the noise of a ball centre, by the marginal likelihood
/// (noise.hpp, prior.hpp).

#include <string>

#include "abbe/calib/evemu/prior.hpp"
#include "abbe/calib/evemu/solve.hpp"

namespace abbe::calib::evemu {

/// Natural logarithm of how much more likely the data are to be with slow noise to have it
/// estimated. White noise alone reaches it in 1 of 40 runs (twice the logarithm is chi2 of one
/// degree of freedom, or 0 half the time).
inline constexpr double kWorthSlowNoise = 2.0;

struct SlowNoise {
  double per_s = 0.0;           ///< Observations::slow_noise
  double log_likelihood = 0.0;  ///< natural logarithm of how much more likely the data are with it
};
/// The most likely one, 0.35 to 11 s. `start`: hyper-parameters without it. NotConverged where a
/// comparison fails.
[[nodiscard]] Result<SlowNoise> likely_slow_noise(const Observations&, const ScaledDesign&,
                                                  const HyperParameters& start);

/// Standard deviation per coordinate [m], and what to do.
[[nodiscard]] std::string slow_noise_text(double slow_noise_m);

[[nodiscard]] Observations with_slow_noise(const Observations&, double per_s);

}  // namespace abbe::calib::evemu
