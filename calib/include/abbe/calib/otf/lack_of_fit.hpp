#pragma once
/// What the residuals of a run show beyond noise. The model is compared with alternatives, each of
/// which adds a few columns C to the adjustment y = A U + C d (the tracker moved, the machine
/// drifts, an axis has backlash, a vertex or a leg of the path was driven elsewhere, the ranges
/// have an offset), or replaces its design (another order of the axes, closer nodes). With r the
/// residuals of the model, Q = (A^T W^2 A)^-1 in the gauge:
///     S = C^T W^2 C - C^T W^2 A Q A^T W^2 C,   d = S^+ C^T W^2 r,   drop of chi2 = d^T C^T W^2 r,
/// and the model without the alternative is wrong by V of dU = Q A^T W^2 C d. Not seen: whatever the model
/// can follow (scale of the ranges, expansion, a path file that is turned or moved as a whole).

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/otf/solve.hpp"

namespace abbe::calib::otf {

/// Noise of the whitened residuals, in units of the stated standard uncertainty.
struct ResidualNoise {
  double sigma0 = 1.0;  ///< square root of chi2 per degree of freedom
  /// From block to block alone: second differences along a leg, which no slow effect enters; median
  /// based.
  double local = 1.0;
  /// 1 + 2 sum of the autocorrelations along a leg, as far as they are significant: how many blocks
  /// carry the information of one [Bartlett 1946]. 1 for white noise.
  double correlation = 1.0;

  /// By what the covariance of white noise of the stated size has to be multiplied; at least 1.
  [[nodiscard]] double variance_factor() const;
};
/// `residual_m` of every row. `degrees_of_freedom`: rows - rank.
[[nodiscard]] ResidualNoise residual_noise(const Observations&, std::span<const double> residual_m,
                                           std::size_t degrees_of_freedom);

/// Root mean squares over the nodes, without the best-fit rigid motion.
struct CorrectionSize {
  double V_m = 0.0;
  double u_m = 0.0;  ///< standard uncertainty of V: root of the trace
};
[[nodiscard]] CorrectionSize correction_size(const VolumetricModel& of_tables);

enum class Cause {
  Moved,
  Drift,
  Backlash,
  Vertex,
  Leg,
  RangeOffset,
  ChainOrder,
  NodeSpacing,
  CorrelatedNoise
};
[[nodiscard]] std::string_view name(Cause);

struct Alternative {
  Cause cause;
  std::string text;        ///< what happened, where and how much
  double explained = 0.0;  ///< share of the chi2 beyond local noise that it takes away
  double bias_m = 0.0;     ///< rms change of V over the nodes, without rigid motion, that it brings
  double u_m = 0.0;        ///< rms standard uncertainty of V if it holds, without rigid motion
};

/// The significant ones (family-wise error probability 1e-4), the largest share first; one of each
/// cause. CorrelatedNoise stands alone where no other explains half of what is left.
[[nodiscard]] Result<std::vector<Alternative>> alternatives(const Observations&, const Solution&,
                                                            const Options& = {});

}  // namespace abbe::calib::otf
