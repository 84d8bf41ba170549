#pragma once
/// Simultaneous estimate of alignment and errors by Gauss-Newton. The alignment of observe()
/// rotates the tracker by what a rigid motion can take from the errors of the machine, and the rows
/// are those of nominal points that belong to this pose. Both are wrong by the second order of the
/// errors, which one linear adjustment does not remove. Here the observations are linearised again
/// at the estimate, with the rigid motion t, r and the tables U of the last adjustment:
///     R <- Rot(-r) R,   T <- Rot(-r) (T - t)
///     c: point of the leg closest to p - V(U, c),   d' = d + dV/ds
///     y = a . (p - c),   a = a2, a3 of d' and the beam
/// p: measured point in the machine, d: direction of the leg, s: length along it. The columns of a
/// row are those of the nominal point c, averaged over the sub-points of the segment. So a row has
/// the same form as that of observe(), and solve() and judge() use both alike: the adjustment
/// yields the whole U, and rigid unknowns near zero.

#include "abbe/calib/internal/otf/observe/along_rows.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// The observations of the same segments linearised at `U` (Observations::unknowns() values). Legs,
/// used segments and covered points remain those of `o`. `series`, `noise`: from which `o` was
/// made.
[[nodiscard]] Observations linearised_at(Observations o, const Eigen::VectorXd& U,
                                         const SegmentSeries& series, const Noise& noise);

/// Observations linearised at their own solution.
struct ObservationsAtSolution {
  Observations observations;
  RowInformation information;  ///< of all rows
  int adjustments = 0;         ///< solved until the estimate did not change any more
};
/// NotConverged after Options::max_adjustments; RankDeficient as solve(). Observations that are too
/// few are returned as they are: solve() reports them. With `along`, each linearisation also adds
/// the rows along the direction of travel, and each adjustment corrects its clock.
[[nodiscard]] Result<ObservationsAtSolution> linearise_at_solution(Observations,
                                                                   const SegmentSeries&,
                                                                   const Noise&, const Options&,
                                                                   AlongRows* along = nullptr);

}  // namespace abbe::calib::otf
