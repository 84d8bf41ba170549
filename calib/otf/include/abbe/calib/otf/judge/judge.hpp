#pragma once
/// Stage three: cross-validation. Compares how well the candidate predicts observations to which it
/// was not fitted with no compensation and with the active model.
///
/// Leg i belongs to fold i mod k, so that neighbours in time are in different folds and every fold
/// covers the whole volume. The model for a fold is fitted to the other folds.
///
/// The alignment removes from the observations a rigid motion that depends on the errors of the
/// machine; no model contains this motion. Therefore, on each held-out fold, the best-fit rigid
/// motion (six parameters, same rows) is removed from the residuals of no compensation, candidate
/// and active model separately, and the remaining residuals are compared. The comparison is
/// therefore also independent of the datums.

#include <cstddef>
#include <functional>
#include <span>

#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Called once for each held-out row: residuals [m] of no compensation and of the candidate that
/// remain after removal of the best-fit rigid motion. `row`: index in Observations::rows of the
/// run.
using HeldOutRow = std::function<void(std::size_t run, std::size_t row, double no_compensation_m,
                                      double candidate_m)>;

/// Computes the held-out figures of one run. `active`, the model in use, may be null. It is
/// compared on the rows inside its validity volume, and not at all if it is not valid for the
/// target offset of this run. If a node of the tables has observations from one leg only, this leg
/// is never held out, because without the leg the node is not determined; the observations of the
/// leg are counted in `not_held_out`. RankDeficient if no fold can be held out. TooFewObservations
/// if there are fewer legs than folds.
[[nodiscard]] Result<HeldOutFigures> held_out(const Observations&, const VolumetricModel* active,
                                              const Options& = {});

/// Computes the held-out figures of the common adjustment of several runs (targets.hpp). The folds
/// are those of each run. `solutions`: those of the runs, if the observations are those of
/// without_run_effects(). If there is a single run, the drift of the tracker is then estimated
/// again without the held-out legs.
[[nodiscard]] Result<HeldOutFigures> held_out(std::span<const Observations>,
                                              const VolumetricModel* active, const Options& = {},
                                              const HeldOutRow& row = {},
                                              std::span<const Solution> solutions = {});

/// Runs held_out(), decide() and alternatives(). The model is also refused if an alternative
/// changes it by more than its uncertainty, or if the uncertainty is more than half the correction.
[[nodiscard]] Result<Verdict> judge(const Observations&, const Solution&,
                                    const VolumetricModel* active, const GateLimits& = {},
                                    const Options& = {}, const HeldOutRow& row = {});
/// Judges the common adjustment of several runs (targets.hpp): one solution per run, all with the
/// same model. The evidence for the orientation of the path is that of the first run.
[[nodiscard]] Result<Verdict> judge(std::span<const Observations>, std::span<const Solution>,
                                    const VolumetricModel* active, const GateLimits& = {},
                                    const Options& = {}, const HeldOutRow& row = {});

}  // namespace abbe::calib::otf
