#pragma once
/// Estimate with correlated noise. Air turbulence and vibration change slowly, so that the
/// residuals of consecutive segments are correlated. If the rows are weighted as independent, the
/// estimate is not optimal, and the stated uncertainty is too small.
///
/// The noise of the readings of the tracker (range, azimuth, elevation) is the sum of white noise
/// and a slow noise x(t). x(t) of each reading is a stationary Ornstein-Uhlenbeck process with the
/// correlation time tau, the same for all readings, and continues from leg to leg and through gaps.
/// The mean over segment i of duration T is m_i; with the stationary variance 1
///     Var(m_i) = 2 (T/tau - 1 + exp(-T/tau)) (tau/T)^2
/// A row contains
///     y_i = a_i U + d_i . (s_r m_i,r e_r + s_a rho (m_i,a e_a + m_i,e e_e)) + white noise
/// d: direction of the row, e_r: unit vector of the beam, e_a, e_e: horizontal and vertical unit
/// vectors across it, rho: range. The variance of the white noise is kappa sigma_i^2, with the
/// stated sigma_i. Rows along the travel also contain s_t m_i,t: slow noise of the scale readings.
///
/// kappa, s_r, s_a, s_t and tau are not known. They are estimated by restricted maximum likelihood
/// ([Patterson 1971], [Harville 1977]): residuals are smaller and less correlated than the noise,
/// because the estimated unknowns U follow the noise. The restricted likelihood
///     -2 l = log |V| + log |A^T V^-1 A| + (y - A U)^T V^-1 (y - A U),   V: covariance of the rows
/// corrects for this. The offset of the ranges and the drift of the tracker are not among these
/// unknowns: with reference nests, the noise that the estimated drift follows is not corrected for.
/// U is estimated by generalised least squares with V. The Kalman filter of x(t) gives V^-1 and |V|
/// ([Schweppe 1965]): it replaces the rows by (row_i - prediction from all earlier rows) /
/// sqrt(variance of the prediction). These prewhitened rows are then adjusted as independent ones.

#include <array>
#include <cstddef>
#include <span>

#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Noise of the readings of the tracker with the symbols of this header. The default is white noise
/// without slow parts.
struct TrackerNoise {
  double white_factor = 1.0;    ///< kappa: factor of the variance of the white noise
  double slow_range_m = 0.0;    ///< s_r: slow noise of the ranges
  double slow_angle_rad = 0.0;  ///< s_a: slow noise of the angles
  double slow_along_m = 0.0;    ///< s_t: slow noise of the scale readings
  /// tau in s; for segments without times in units of a segment.
  double correlation_time = 0.0;
};

/// True if the residuals of consecutive segments of a leg are correlated in any direction: their
/// coefficient exceeds the 99.9 % quantile for white noise. `residual_m`: one residual per row.
[[nodiscard]] bool is_correlated(const Observations&, std::span<const double> residual_m);

/// Estimates the noise. `residual_m`: y - A U of every row with any U, without range offset and
/// drift of the tracker. NotConverged if Options::stopped returns true, or if the likelihood is not
/// a number.
[[nodiscard]] Result<TrackerNoise> estimate_noise(const Observations&,
                                                  std::span<const double> residual_m,
                                                  const Options& = {});

/// Returns the solution of the prewhitened rows: model, rigid unknowns, their covariance, and
/// `variance_factor` and `noise_correlation` of the statistics. `adjustment`, residuals, range
/// offset, drift of the tracker and the other statistics remain those of the original rows, because
/// judge() tests these for lack of fit. Returns `solution` unchanged if its residuals are not
/// correlated, or if they are so small that the stated noise covers them including their
/// correlation (statistics.variance_factor is 1). Errors of adjust() and estimate_noise().
[[nodiscard]] Result<Solution> prewhitened(Solution, const Observations&, const Options& = {});

}  // namespace abbe::calib::otf
