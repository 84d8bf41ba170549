#pragma once
/// Stage three: how well the model predicts points of interest to which it was not fitted. Each O_i
/// of each pass is left out once, and everything is estimated from the others. With the covariance C
/// of the deviations y of a pass and the design A of all unknowns, priors included,
///     Q = C^-1 - C^-1 A (A^T C^-1 A)^-1 A^T C^-1,   e_i = Q_ii^-1 (Q y)_i
/// is the deviation of the left-out O_i from its prediction, without a second adjustment. Unknowns of
/// the passes (pose, tool, drift) and of the bar belong to every compared model: no compensation has
/// no others, and the active model enters as y - (its errors at the touches). An O_i that the others
/// do not predict to ten times the noise of its touches is not left out. Units: m, rad; k = 1. Pure.

#include "abbe/calib/gate.hpp"
#include "abbe/calib/mfb/identify.hpp"

namespace abbe::calib::mfb {

struct JudgeOptions {
  GateLimits limits{};
  SolveOptions solve{};
};

/// `active`, the model in use, may be null. It is compared at the passes inside its validity volume
/// whose tool it is valid for. Estimator::Sequential has no prediction without an O_i: its figures
/// are those of its tables, with the unknowns of the passes left out as above. Errors of solve().
[[nodiscard]] Result<HeldOutFigures> held_out(const Observations&, const Solution&,
                                              const VolumetricModel* active,
                                              const SolveOptions& = {});

/// The verdict from held_out(), chi-square with its likely cause, and the limits of the gate.
[[nodiscard]] Result<Verdict> judge(const Identification&, const VolumetricModel* active,
                                    const JudgeOptions& = {});

}  // namespace abbe::calib::mfb
