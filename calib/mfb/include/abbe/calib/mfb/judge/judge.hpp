#pragma once
/// Stage three: how well the model predicts points of interest to which it was not fitted. O_i of
/// all passes of one tool in one position are left out together, because what the clamping does to
/// a point is in all of them; everything is estimated from the others. With the covariance C of the
/// deviations y and the design A of all unknowns, priors included,
///     Q = C^-1 - C^-1 A (A^T C^-1 A)^-1 A^T C^-1,   e_g = Q_gg^-1 (Q y)_g
/// is the deviation of the group g from its prediction, without a second adjustment. Unknowns of
/// the passes (pose, tool, drift) and of the bar belong to every compared model: no compensation
/// has no others, and the active model enters as y - (its errors at the touches). A group that the
/// others do not predict to ten times the noise of its points is not left out. Units: m,
/// rad; k = 1. Pure.

#include <string_view>

#include "abbe/calib/mfb/solve/identify.hpp"
#include "abbe/calib/model/gate.hpp"

namespace abbe::calib::mfb {

/// Entry in the configuration that permits a bar more than kMostFromReference_K from 20 C.
inline constexpr std::string_view kBarTemperature = "bar-temperature";
/// The same for one that was warmer or colder at a position than at those next to it
/// (kMostBetweenPositions_K).
inline constexpr std::string_view kBarTemperatureChange = "bar-temperature-change";

struct JudgeOptions {
  GateLimits limits{};
  SolveOptions solve{};
  bool accept_bar_temperature = false;         ///< see kBarTemperature
  bool accept_bar_temperature_change = false;  ///< see kBarTemperatureChange
};

/// `active`, the model in use, may be null. It is compared at the points inside its validity
/// volume, in passes whose tool it is valid for and half of whose points are inside.
/// Estimator::Sequential has no prediction without a point: its figures are those of its tables,
/// with the unknowns of the passes left out as above. Errors of solve().
[[nodiscard]] Result<HeldOutFigures> held_out(const Observations&, const Solution&,
                                              const VolumetricModel* active,
                                              const SolveOptions& = {});

/// The verdict from held_out(), chi-square with its likely cause, the temperature of the bar, and
/// the limits of the gate. A note says on what the scale of the model depends.
[[nodiscard]] Result<Verdict> judge(const Identification&, const VolumetricModel* active,
                                    const JudgeOptions& = {});

}  // namespace abbe::calib::mfb
