#pragma once
/// When a model may be trusted, whatever method it came from: it predicts observations it was not
/// fitted to better than no compensation and, where the active model holds, better than that one;
/// it holds where the active model does but for a rim of 2 %, unless a smaller volume is accepted
/// by name; its scale is that of the active model, unless a change is accepted by name; and it is
/// of a size and smoothness a machine can have.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

/// Residuals of held-out observations, each divided by its standard uncertainty, root mean square
/// (1 = as good as the noise allows). Every contender was given the same freedom of a best-fit
/// rigid motion.
struct HeldOutFigures {
  double no_compensation = 0.0;
  double candidate = 0.0;
  std::size_t observations = 0;
  /// Fitted to in every fold: no other observation determines them, so they cannot be predicted.
  std::size_t not_held_out = 0;
  /// Of the observations inside the active model's volume; none: there is no active model, it does
  /// not hold for this tool, or nothing lies inside. Outside, tables end and polynomials run away:
  /// to do better there means nothing.
  std::optional<double> active{};
  std::optional<double> candidate_beside_active{};  ///< on the same observations as `active`
  std::size_t observations_beside_active = 0;
  /// the same, unweighted, in m: for people
  double no_compensation_rms_m = 0.0;
  double candidate_rms_m = 0.0;
  std::optional<double> active_rms_m{};
};

struct GateLimits {
  /// |V| anywhere; 1 mm: larger is a machine to be repaired, or a wrong path
  double max_error_m = 1e-3;
  double max_gradient = 5e-3;  ///< |dV/dq|, m/m; 5 mm/m: 250 um between nodes 50 mm apart
  /// |growth of the machine alike in all directions|: 200 um/m; larger is a wrong unit, path, range
  /// or temperature.
  double max_scale_error = 200e-6;
  /// |growth alike in all directions against the active model| beside twice its standard
  /// uncertainty: 20 um/m are 1.7 K of steel. More is a wrong scale of path, ranges or temperature,
  /// or another machine.
  double max_scale_change = 20e-6;
  /// required relative drop of the held-out figure; 0: merely better
  double min_improvement = 0.0;
  bool accept_smaller_volume = false;  ///< than that of the active model
  bool accept_scale_change = false;    ///< beyond max_scale_change
};

/// The name under which a configuration lets a model replace one that holds in more of the machine.
inline constexpr std::string_view kSmallerVolume = "smaller-volume";

/// The name under which a configuration lets a model replace one from which its scale differs.
inline constexpr std::string_view kScaleChange = "scale-change";

/// Share of the volume of `before` that lies in `after`, from points on a lattice over `before`: to
/// a few per cent. What lies beside `after` by no more than `rim` of its width counts as in it.
[[nodiscard]] double kept_share(const ValidityVolume& before, const ValidityVolume& after,
                                double rim = 0.0);

/// Accepted only if `reasons` is empty.
struct Verdict {
  bool accepted = false;
  std::vector<std::string> reasons;  ///< one sentence with numbers for every broken rule
  /// Of `reasons`, one each in the same order, for programs: the name of a Cause of the method's
  /// lack_of_fit.hpp, or held-out, nowhere, size, slope, volume, scale-change, growth, uncertainty,
  /// orientation, shape-only, damage.
  std::vector<std::string> causes;
  std::vector<std::string> notes;  ///< what else to know about the comparison; breaks no rule
  HeldOutFigures held_out;
  double max_error_m = 0.0;   ///< of the candidate, where decide() looked
  double max_gradient = 0.0;  ///< |dV/dq| along an axis, there

  /// One reason more: last, or before that of index `before`.
  void refuse(std::string_view cause, std::string text);
  void refuse(std::string_view cause, std::string text, std::size_t before);
};

/// Pure. `active` may be null. Magnitude and gradient of tables are taken on the tensor grid of the
/// nodes (V is linear between them along each axis); of polynomials, where it holds: at the
/// vertices of its hull (all of them readings), halfway between any two, and at the nodes inside. A
/// model with no such place is refused.
[[nodiscard]] Verdict decide(const VolumetricModel& candidate, const HeldOutFigures&,
                             const GateLimits& = {}, const VolumetricModel* active = nullptr);

}  // namespace abbe::calib
