#pragma once
/// Tests of the residuals of a run for lack of fit. The model is compared with alternatives. An
/// alternative is one of
/// - a few additional columns C in the adjustment y = A U + C d: the tracker moved, the machine
///   drifts, an axis has backlash, a vertex or a leg of the path was driven at another position,
///   the ranges have an offset, or have an offset after a beam break,
/// - another design matrix: another order of the axes, or closer nodes.
///
/// With the residuals r of the model, the weights W of the rows (1/sigma) and Q = (A^T W^2 A)^-1,
/// restricted by the datum conditions (estimation/datum.hpp):
///     S = C^T W^2 C - C^T W^2 A Q A^T W^2 C,   d = S^+ C^T W^2 r
///     decrease of chi2 = d^T C^T W^2 r
///     dU = Q A^T W^2 C d: error of U if the alternative is true but not modelled
/// Effects that the model can reproduce are not detected: scale of the ranges, thermal expansion, a
/// path file that is rotated or shifted as a whole.

#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/otf/solve/residual_noise.hpp"
#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Root mean squares of V and of its standard uncertainty over the nodes, after removal of the
/// best-fit rigid motion.
struct CorrectionSize {
  double V_m = 0.0;
  double u_m = 0.0;  ///< standard uncertainty of V: root of the trace of its covariance
};
[[nodiscard]] CorrectionSize correction_size(const VolumetricModel& of_tables);

enum class Cause {
  Moved,
  Drift,
  Backlash,
  Vertex,
  Leg,
  RangeOffset,
  RangeStep,
  ChainOrder,
  NodeSpacing,
  OtherRuns,
  CorrelatedNoise
};
[[nodiscard]] std::string_view name(Cause);

struct Alternative {
  Cause cause;
  std::string text;        ///< cause, location and magnitude
  double explained = 0.0;  ///< fraction of (chi2 - chi2 of local noise) that the cause explains
  double bias_m = 0.0;     ///< rms change of V over the nodes, rigid motion removed
  double u_m = 0.0;        ///< rms u of V if the alternative is true, rigid motion removed
};

/// Returns the significant alternatives (family-wise error probability 1e-4), at most one per
/// cause, sorted by `explained`, largest first. CorrelatedNoise is put first if the residuals are
/// correlated and no alternative has `explained` of one half or more. With Tables::OfSeveralRuns
/// (targets.hpp) the run is compared with a fit by its own tables, instead of with another order of
/// axes or closer nodes. The two latter would also fit the differences between the runs.
enum class Tables { OfThisRun, OfSeveralRuns };
[[nodiscard]] Result<std::vector<Alternative>> alternatives(const Observations&, const Solution&,
                                                            const Options& = {},
                                                            Tables = Tables::OfThisRun);

}  // namespace abbe::calib::otf
