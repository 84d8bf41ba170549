#pragma once
/// Estimate with correlated noise. Air turbulence and vibration change slowly: the residuals of
/// consecutive blocks are then correlated, and rows that are weighted as independent ones are
/// neither used best nor as certain as the adjustment states. The noise of the rows along a2, and
/// that along a3, is modelled as autoregressive along each leg, with w = residual / sigma of the
/// used blocks of a leg that follow one another:
///     w_i = phi_1 w_i-1 + ... + phi_p w_i-p + e_i,   Var(e) = v_p Var(w)
/// The coefficients follow from the autocorrelations of the residuals by the recursion of Levinson
/// and Durbin; p is the largest order, at most kMostOrder, whose
/// coefficients are significant. Rows become (row_i - sum phi_k row_i-k) / sqrt(v_p), and the first
/// ones of a leg are predicted from the fewer rows before them. Nothing crosses a leg, a lost block
/// or a corner, so that legs remain independent groups.

#include <array>
#include <cstddef>
#include <span>

#include "abbe/calib/otf/solve.hpp"

namespace abbe::calib::otf {

/// Noise of one direction, white for order 0.
struct Autoregression {
  /// Means of correlated noise over blocks, and such means with white noise, need two.
  static constexpr std::size_t kMostOrder = 2;
  std::size_t order = 0;
  /// phi_1 to phi_k of the prediction from k rows.
  std::array<std::array<double, kMostOrder>, kMostOrder + 1> coefficient{};
  /// v_k: what remains of the variance after the prediction from k rows.
  std::array<double, kMostOrder + 1> variance{1.0, 1.0, 1.0};

  /// Autocorrelation from one block to the next.
  [[nodiscard]] double lag_1() const { return coefficient[1][0]; }
};

struct NoiseFilter {
  std::array<Autoregression, 3> of_direction;  ///< a2, a3, along (white without such rows)
  [[nodiscard]] bool is_white() const {
    return of_direction[0].order == 0 && of_direction[1].order == 0 && of_direction[2].order == 0;
  }
};
/// `residual_m`: one residual per row.
[[nodiscard]] NoiseFilter noise_filter(const Observations&, std::span<const double> residual_m);

/// The solution of the prewhitened rows: model, rigid unknowns, their covariance, and in the
/// statistics `variance_factor` and `noise_correlation`. `adjustment`, residuals, range offset,
/// drift of the tracker and the other statistics remain those of the rows themselves, which judge()
/// tests for lack of fit. The coefficients are estimated twice: from the residuals of `solution`,
/// then from those of the prewhitened solution. `solution` itself if its residuals are white, or if
/// they are so small that the stated noise covers them with their correlation
/// (statistics.variance_factor is 1): the correlation then is not that of the stated noise. Errors
/// of adjust().
[[nodiscard]] Result<Solution> prewhitened(Solution, const Observations&, const Options& = {});

}  // namespace abbe::calib::otf
