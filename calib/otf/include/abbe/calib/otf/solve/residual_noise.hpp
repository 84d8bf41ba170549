#pragma once
/// Computes the noise of the residuals of a run, for its uncertainty and for the tests of
/// lack_of_fit.hpp. Pure.

#include <cstddef>
#include <optional>
#include <span>

#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// Noise of the whitened residuals, in units of the stated standard uncertainty.
struct ResidualNoise {
  double sigma0 = 1.0;  ///< square root of chi2 per degree of freedom
  /// Noise between neighbouring segments, from the median of second differences along a leg. Slow
  /// effects do not contribute to it.
  double local = 1.0;
  /// 1 + 2 * sum of the significant autocorrelations along a leg [Bartlett 1946]: the number of
  /// correlated segments that carry as much information as one independent segment. 1 for white
  /// noise.
  double correlation = 1.0;

  /// Factor for the covariance computed with the stated, white noise; at least 1.
  [[nodiscard]] double variance_factor() const;
};
/// Computes the noise. `residual_m`: one residual per row. `degrees_of_freedom`: rows - rank. `of`:
/// if given, only the rows of this component are used.
[[nodiscard]] ResidualNoise residual_noise(const Observations&, std::span<const double> residual_m,
                                           std::size_t degrees_of_freedom,
                                           std::optional<std::size_t> of = {});

}  // namespace abbe::calib::otf
