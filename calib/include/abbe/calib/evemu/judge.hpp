#pragma once
/// Stage three: how well the model predicts positions it was not fitted to. Every position is left
/// out once and the model fitted to the others, hyper-parameters included (not lambda and gamma of
/// the sparse estimators: those stay as chosen). A position's direction is known only through its
/// blocks, so every contender gets its own best-fit rotation about Ball1 there, the same three
/// numbers of freedom from the same rows, and is compared by what remains over the noise balls
/// share. What this test cannot see is a rotation common to all positions (observe.hpp). A model
/// with an unreferenced rotation is a shape: it is refused unless somebody accepts that by name.

#include "abbe/calib/evemu/lack_of_fit.hpp"
#include "abbe/calib/evemu/solve.hpp"
#include "abbe/calib/gate.hpp"

namespace abbe::calib::evemu {

/// The name under which a configuration accepts a model whose rotation nobody has referenced.
inline constexpr std::string_view kShapeOnly = "evemu-shape-only";

struct JudgeOptions {
  GateLimits limits{};
  bool accept_shape_only = false;
  SolveOptions solve{};
  Watch watch{};  ///< progress: the first half for lack of fit, the second for the held-out test
};

/// `active` may be null; it is compared at the balls inside its volume, of positions whose Ball1
/// is, and left out if it does not hold for the tool. Needs 3 positions, else TooFewObservations;
/// RankDeficient if those that stay do not determine the model.
[[nodiscard]] Result<HeldOutFigures> held_out(const Observations&, double s_m,
                                              const VolumetricModel* active,
                                              const SolveOptions& = {}, const Watch& = {});

/// held_out(), the limits of the gate, and the rotation.
[[nodiscard]] Result<Verdict> judge(const Observations&, const Solution&,
                                    const VolumetricModel* active, const JudgeOptions& = {});

}  // namespace abbe::calib::evemu
