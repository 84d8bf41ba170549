#pragma once
/// When a model may be trusted, whatever method it came from: it predicts observations it was not fitted to
/// better than no compensation and better than the active model, and it is of a size and smoothness a machine
/// can have.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

/// Residuals of held-out observations, each divided by its standard uncertainty, root mean square (1 = as
/// good as the noise allows). Every contender was given the same freedom of a best-fit rigid motion.
struct HeldOutFigures {
  double no_compensation = 0.0;
  double candidate = 0.0;
  std::optional<double> active{};  ///< none: no active model, or it does not hold for this tool
  std::size_t observations = 0;
  /// the same, unweighted, in m: for people
  double no_compensation_rms_m = 0.0;
  double candidate_rms_m = 0.0;
  std::optional<double> active_rms_m{};
};

struct GateLimits {
  double max_error_m = 1e-3;     ///< |V| anywhere; 1 mm: larger is a machine to be repaired, or a wrong path
  double max_gradient = 5e-3;    ///< |dV/dq|, m/m; 5 mm/m: 250 um between nodes 50 mm apart
  double min_improvement = 0.0;  ///< required relative drop of the held-out figure; 0: merely better
};

/// Accepted only if `reasons` is empty.
struct Verdict {
  bool accepted = false;
  std::vector<std::string> reasons;  ///< one sentence with numbers for every broken rule
  HeldOutFigures held_out;
  double max_error_m = 0.0;  ///< of the candidate on the grid of its nodes
  double max_gradient = 0.0;
};

/// Pure. Magnitude and gradient are taken on the tensor grid of the nodes (V is linear between them along
/// each axis).
[[nodiscard]] Verdict decide(const VolumetricModel& candidate, const HeldOutFigures&, const GateLimits& = {});

}  // namespace abbe::calib
