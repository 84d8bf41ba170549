#pragma once
/// Simultaneous estimate of alignment and errors by Gauss-Newton. The alignment of observe()
/// absorbs a rigid motion from the errors of the machine, and the rows belong to the nominal points
/// of this pose. Pose and points have errors of second order in the machine errors, which one
/// linear adjustment does not remove. Here the observations are linearised again at the estimate,
/// with the rigid motion t, r and the tables U of the last adjustment:
///     R <- Rot(-r) R,   T <- Rot(-r) (T - t)
///     c: point of the leg closest to p - V(U, c),   d' = d + dV/ds
///     y = a . (p - c),   a = a2, a3 of d' and the beam
/// p: measured point in the machine, d: direction of the leg, s: length along it. The columns of a
/// row are those of the nominal point c, averaged over the sub-points of the segment. A row
/// therefore has the same form as that of observe(), and solve() and judge() treat both in the same
/// way. The adjustment yields the complete U, and rigid unknowns near zero.

#include "abbe/calib/internal/otf/observe/along_rows.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Linearises the observations of the same segments again, at `U` (Observations::unknowns()
/// values). Legs, used segments and covered points remain those of `o`. `series`, `noise`: those
/// from which `o` was made.
[[nodiscard]] Observations linearised_at(Observations o, const Eigen::VectorXd& U,
                                         const SegmentSeries& series, const Noise& noise);

/// Observations linearised at their own solution.
struct ObservationsAtSolution {
  Observations observations;
  RowInformation information;  ///< information of all rows
  int adjustments = 0;         ///< number of adjustments until the estimate did not change any more
};
/// Linearises repeatedly at the solution. NotConverged after Options::max_adjustments;
/// RankDeficient as solve(). If there are too few observations, they are returned unchanged, and
/// solve() reports the error. With `along`, each linearisation also adds the rows along the
/// direction of travel, and each adjustment corrects its clock.
[[nodiscard]] Result<ObservationsAtSolution> linearise_at_solution(Observations,
                                                                   const SegmentSeries&,
                                                                   const Noise&, const Options&,
                                                                   AlongRows* along = nullptr);

}  // namespace abbe::calib::otf
