#pragma once
/// Stage three: tests how well the model predicts positions of the array that the fit did not use.
/// Each position is left out once, and the model is fitted to the others, hyper-parameters included
/// (lambda and gamma of the sparse estimators are not chosen again). The orientation of the array
/// at a position is known only from its blocks, which the machine touches with its own errors.
/// Therefore every compared model gets its own best-fit rotation about Ball1 at the position left
/// out: three degrees of freedom from the same rows. The models are compared by the residuals that
/// remain, whitened with the covariance of noise.hpp. This test cannot detect a rotation common to
/// all positions (observe.hpp). If no other measurement determines this rotation, the model is
/// correct in shape only. Such a model is refused unless the configuration accepts
/// "evemu-shape-only".

#include "abbe/calib/evemu/judge/lack_of_fit.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/calib/model/gate.hpp"

namespace abbe::calib::evemu {

/// Entry in the configuration that permits a model whose rotation about Ball1 was not measured.
inline constexpr std::string_view kShapeOnly = "evemu-shape-only";

struct JudgeOptions {
  GateLimits limits{};
  bool accept_shape_only = false;
  SolveOptions solve{};
  Watch watch{};  ///< progress 0 to 0.5: test for lack of fit, 0.5 to 1: held-out test
};

/// Computes the held-out figures. `active`, the model in use, may be null. It is compared at the
/// balls inside its validity volume, at positions whose Ball1 is inside this volume too; it is not
/// compared if it is not valid for the tool. Needs 3 positions, else TooFewObservations;
/// RankDeficient if the positions that remain when one is left out do not determine the model.
[[nodiscard]] Result<HeldOutFigures> held_out(const Observations&, double s_m,
                                              const VolumetricModel* active,
                                              const SolveOptions& = {}, const Watch& = {});

/// Computes the verdict from held_out(), alternatives(), the limits of the gate and the rotation
/// reference.
[[nodiscard]] Result<Verdict> judge(const Observations&, const Solution&,
                                    const VolumetricModel* active, const JudgeOptions& = {});

}  // namespace abbe::calib::evemu
