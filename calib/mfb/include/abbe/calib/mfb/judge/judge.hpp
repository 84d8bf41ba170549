#pragma once
/// Stage three: tests how well the model predicts points of interest to which it was not fitted.
/// O_i of all passes of one tool in one position are left out together, because the clamping
/// displaces a point equally in all of them. All unknowns are estimated from the other points. With
/// the covariance C of the deviations y and the design A of all unknowns, priors included,
///     Q = C^-1 - C^-1 A (A^T C^-1 A)^-1 A^T C^-1,   e_g = Q_gg^-1 (Q y)_g
/// is the deviation of the group g from its prediction, without a second adjustment. Every compared
/// model has the unknowns of the passes (pose, tool, drift) and of the bar. The model without
/// compensation has no further unknowns; for the active model y is replaced by y - (its errors at
/// the touches). A group is not left out if the other points predict it only with more than ten
/// times the noise of its points. Units: m,
/// rad; k = 1. Pure.

#include <string_view>

#include "abbe/calib/mfb/solve/identify.hpp"
#include "abbe/calib/model/gate.hpp"

namespace abbe::calib::mfb {

/// Entry in the configuration that permits a bar temperature more than kMostFromReference_K from 20
/// C.
inline constexpr std::string_view kBarTemperature = "bar-temperature";
/// Entry in the configuration that permits a bar that was warmer or colder at a position than at
/// the positions next to it (kMostBetweenPositions_K).
inline constexpr std::string_view kBarTemperatureChange = "bar-temperature-change";

struct JudgeOptions {
  GateLimits limits{};
  SolveOptions solve{};
  bool accept_bar_temperature = false;         ///< see kBarTemperature
  bool accept_bar_temperature_change = false;  ///< see kBarTemperatureChange
};

/// Computes the held-out figures. `active`, the model in use, may be null. It is compared at the
/// points inside its validity volume, in passes for whose tool it is valid and half of whose points
/// are inside. Estimator::Sequential cannot predict a point that was left out: its figures use its
/// tables from all points, with the unknowns of the passes left out as above. Errors of solve().
[[nodiscard]] Result<HeldOutFigures> held_out(const Observations&, const Solution&,
                                              const VolumetricModel* active,
                                              const SolveOptions& = {});

/// Computes the verdict from held_out(), chi-square with its likely cause, the temperature of the
/// bar, and the limits of the gate. A note states what determines the scale of the model.
[[nodiscard]] Result<Verdict> judge(const Identification&, const VolumetricModel* active,
                                    const JudgeOptions& = {});

}  // namespace abbe::calib::mfb
