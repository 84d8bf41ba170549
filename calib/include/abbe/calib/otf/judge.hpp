#pragma once
/// Stage three: how well the method predicts observations it was not fitted to, against no
/// compensation and against the active model. Legs are dealt into folds (leg i into fold i mod k:
/// neighbours in time part, every fold spreads over the volume); the model for a fold is fitted to
/// the other folds. The alignment took a rigid motion out of y that depends on the machine's
/// errors, and no model contains it. Every contender therefore gets its own best-fit rigid motion
/// on each held-out fold, the same six numbers of freedom from the same rows, and is compared by
/// what remains. That makes the comparison independent of gauges, too.

#include "abbe/calib/gate.hpp"
#include "abbe/calib/otf/lack_of_fit.hpp"
#include "abbe/calib/otf/solve.hpp"

namespace abbe::calib::otf {

/// `active` may be null; it is compared on the rows inside its volume, and left out if it does not
/// hold for this run's target offset.
/// A leg that alone touches a node of the tables is never held out: without it the node is
/// anything. Such observations are counted. RankDeficient if no fold can be left out,
/// TooFewObservations with fewer legs than folds.
[[nodiscard]] Result<HeldOutFigures> held_out(const Observations&, const VolumetricModel* active,
                                              const Options& = {});

/// held_out(), the limits of the gate, and what the residuals show: an alternative that moves the
/// model by more than its uncertainty refuses it, and so does an uncertainty of half the correction
/// and more.
[[nodiscard]] Result<Verdict> judge(const Observations&, const Solution&,
                                    const VolumetricModel* active, const GateLimits& = {},
                                    const Options& = {});

}  // namespace abbe::calib::otf
