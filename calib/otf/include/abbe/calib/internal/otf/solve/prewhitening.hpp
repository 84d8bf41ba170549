#pragma once
/// Estimate with correlated noise. Air turbulence and vibration change slowly: the residuals of
/// consecutive segments are then correlated, and rows that are weighted as independent ones are
/// neither used best nor as certain as the adjustment states.
///
/// The noise of the readings of the tracker - range, azimuth, elevation - is white noise and a
/// slow noise x(t) beside it. x(t) of each reading is a stationary Ornstein-Uhlenbeck process with
/// the correlation time tau, the same for all readings, and continues from leg to leg and through
/// gaps. The mean over segment i of duration T is m_i; with the stationary variance 1
///     Var(m_i) = 2 (T/tau - 1 + exp(-T/tau)) (tau/T)^2
/// A row sees
///     y_i = a_i U + d_i . (s_r m_i,r e_r + s_a rho (m_i,a e_a + m_i,e e_e)) + white noise
/// d: direction of the row, e_r: unit vector of the beam, e_a, e_e: horizontal and vertical unit
/// vectors across it, rho: range. The variance of the white noise is kappa sigma_i^2, with the
/// stated sigma_i. Rows along the travel see s_t m_i,t, too: slow noise of the scale readings.
///
/// kappa, s_r, s_a, s_t and tau are not known. They are estimated by restricted maximum likelihood
/// ([Patterson 1971], [Harville 1977]): residuals are smaller and less correlated than the noise,
/// because the unknowns U follow it, and the restricted likelihood
///     -2 l = log |V| + log |A^T V^-1 A| + (y - A U)^T V^-1 (y - A U),   V: covariance of the rows
/// corrects for it. The offset of the ranges and the drift of the tracker are not among these
/// unknowns: with reference nests, the noise that the drift follows is not corrected for.
/// U: generalised least squares with V. The Kalman filter of x(t) gives V^-1 and
/// |V| ([Schweppe 1965]): rows become (row_i - prediction from all earlier rows) / sqrt(variance
/// of the prediction). These prewhitened rows are then adjusted as independent ones.

#include <array>
#include <cstddef>
#include <span>

#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Noise of the readings of the tracker, see above. White without the slow parts.
struct TrackerNoise {
  double white_factor = 1.0;    ///< kappa
  double slow_range_m = 0.0;    ///< s_r
  double slow_angle_rad = 0.0;  ///< s_a
  double slow_along_m = 0.0;    ///< s_t
  /// tau in s; for segments without times in units of a segment.
  double correlation_time = 0.0;
};

/// True if the residuals of consecutive segments of a leg are correlated, in any direction, with a
/// coefficient above the 99.9 % quantile of white noise. `residual_m`: one residual per row.
[[nodiscard]] bool is_correlated(const Observations&, std::span<const double> residual_m);

/// `residual_m`: y - A U of every row with any U, without range offset and drift of the tracker.
/// NotConverged if Options::stopped returns true, or if the likelihood is not a number.
[[nodiscard]] Result<TrackerNoise> estimate_noise(const Observations&,
                                                  std::span<const double> residual_m,
                                                  const Options& = {});

/// The solution of the prewhitened rows: model, rigid unknowns, their covariance, and in the
/// statistics `variance_factor` and `noise_correlation`. `adjustment`, residuals, range offset,
/// drift of the tracker and the other statistics remain those of the rows themselves, which judge()
/// tests for lack of fit. `solution` itself if its residuals are not correlated, or if
/// they are so small that the stated noise covers them with their correlation
/// (statistics.variance_factor is 1): the correlation then is not that of the stated noise. Errors
/// of adjust() and estimate_noise().
[[nodiscard]] Result<Solution> prewhitened(Solution, const Observations&, const Options& = {});

}  // namespace abbe::calib::otf
