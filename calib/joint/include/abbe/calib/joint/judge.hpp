#pragma once
/// Judges a joint model (identify.hpp) with the rules of the gate.
///
/// Held-out test: leg i of every run belongs to fold i mod k. For each fold, each run is adjusted
/// without the legs of the fold and is converted to a part. All parts then give one model. This
/// model predicts the legs of the fold. From the residuals the best-fit rigid motion of each run is
/// removed, as in otf/judge/judge.hpp. The parts of arrays are used in every fold.

#include <cstddef>
#include <span>
#include <string>

#include "abbe/calib/joint/identify.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::joint {

/// The observations of a part that part_of_run() made.
struct RunOfPart {
  std::size_t part = 0;  ///< index of the part
  /// Observations without the estimated range offset (otf::without_range_offset). Must outlive the
  /// call.
  const otf::Observations* observations = nullptr;
  CommonEffects effects{};  ///< the effects with which the part was made
};

/// Computes the held-out figures. `active`, the model in use, may be null; it is compared where it
/// is valid. `options`: number of folds, progress and stop. BadInput without runs;
/// TooFewObservations if a run has fewer legs than folds; RankDeficient if no fold can be held out.
[[nodiscard]] Result<HeldOutFigures> held_out(std::span<const Part>, std::span<const RunOfPart>,
                                              const CommonTables&, const VolumetricModel* active,
                                              const otf::Options& options = {});

/// Computes the verdict on the joint model: held_out(), decide(), scale and uncertainty.
[[nodiscard]] Result<Verdict> judge(const JointModel&, std::span<const Part>,
                                    std::span<const RunOfPart>, const CommonTables&,
                                    const VolumetricModel* active, const GateLimits& = {},
                                    const otf::Options& options = {});

/// Adds the verdict on one part, which its own method computed. Reasons that are faults of the data
/// (moved, drift, backlash, ball, orientation ...) also refuse the joint model. Other reasons
/// concern only the model that the part alone would give: its held-out test, size, uncertainty,
/// volume, the form of its polynomials, a rotation that it does not determine. They become notes,
/// as do the notes of the part. Each text begins with `part`.
void add_verdict_of_part(Verdict&, const std::string& part, const Verdict& of_part);

}  // namespace abbe::calib::joint
