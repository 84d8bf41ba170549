#pragma once
/// Acceptance test for an identified model (the candidate), common to all identification methods.
/// The active model is the one in use on the machine. A candidate is accepted if all of the
/// following are true:
/// - It predicts observations to which it was not fitted better than no compensation does and,
///   inside the validity volume of the active model, better than the active model does.
/// - Its validity volume contains that of the active model, apart from a rim of 2 %, unless the
///   configuration accepts "smaller-volume".
/// - Its scale agrees with that of the active model, unless the configuration accepts
///   "scale-change".
/// - Magnitude and gradient of V are within the limits of a real machine.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// Root mean square of the residuals of held-out observations, each residual divided by its
/// standard uncertainty (1: the residuals are as small as the noise permits). The compared models
/// are no compensation, the candidate and the active model; from the residuals of each the best-fit
/// rigid motion is removed first.
struct HeldOutFigures {
  double no_compensation = 0.0;
  double candidate = 0.0;
  std::size_t observations = 0;
  /// Number of observations that were never held out, because the model is not determined without
  /// them.
  std::size_t not_held_out = 0;
  /// Figure of the active model, from the observations inside its validity volume only: outside
  /// this volume the active model extrapolates, and a comparison is meaningless. nullopt if there
  /// is no active model, if it is not valid for this tool, or if no observation is inside.
  std::optional<double> active{};
  std::optional<double> candidate_beside_active{};  ///< from the same observations as `active`
  std::size_t observations_beside_active = 0;
  /// The figures above from residuals in m, not divided by their uncertainty; for display.
  double no_compensation_rms_m = 0.0;
  double candidate_rms_m = 0.0;
  std::optional<double> active_rms_m{};
};

struct GateLimits {
  /// Largest |V| in the volume, without rigid motion. 1 mm: with a larger error the machine needs
  /// repair, or the path is wrong.
  double max_error_m = 1e-3;
  double max_gradient = 5e-3;  ///< |dV/dq| in m/m; 5 mm/m: 250 um between nodes 50 mm apart
  /// Largest absolute value of the scale error common to all directions. 200 um/m: a larger value
  /// means a wrong unit, path, range or temperature.
  double max_scale_error = 200e-6;
  /// Largest absolute value of the scale difference to the active model, common to all directions.
  /// Twice the standard uncertainty of this difference is added to the limit. 20 um/m: steel at 1.7
  /// K temperature difference. A larger value means a wrong scale of path, ranges or temperature,
  /// or a changed machine.
  double max_scale_change = 20e-6;
  /// Required relative decrease of the held-out figure; 0: any decrease is sufficient.
  double min_improvement = 0.0;
  bool accept_smaller_volume = false;  ///< accept a validity volume smaller than that of the active
                                       ///< model
  bool accept_scale_change = false;    ///< accept a scale difference above max_scale_change
};

/// Entry in the configuration that permits a model to replace an active model with a larger
/// validity volume.
inline constexpr std::string_view kSmallerVolume = "smaller-volume";

/// Entry in the configuration that permits a model to replace an active model with a different
/// scale.
inline constexpr std::string_view kScaleChange = "scale-change";

/// Fraction of the volume of `before` that is inside `after`, estimated with the points of a
/// lattice over `before`, accurate to a few per cent. Points outside `after` by at most the
/// fraction `rim` of the width of `after` count as inside.
[[nodiscard]] double kept_share(const ValidityVolume& before, const ValidityVolume& after,
                                double rim = 0.0);

/// Result of the gate. A model is accepted only if `reasons` is empty.
struct Verdict {
  bool accepted = false;
  std::vector<std::string> reasons;  ///< one sentence with numbers for each rule that is not met
  /// Machine-readable identifiers of `reasons`, one each in the same order: the name of a Cause of
  /// the method's lack_of_fit.hpp, or one of held-out, nowhere, size, slope, volume, scale-change,
  /// growth, uncertainty, orientation, outliers, shape-only, damage, bar-temperature,
  /// bar-temperature-change, beams.
  std::vector<std::string> causes;
  std::vector<std::string> notes;  ///< further information that does not refuse the model
  HeldOutFigures held_out;
  /// |V| of the candidate without rigid motion, at the points that decide() evaluates
  double max_error_m = 0.0;
  double max_gradient = 0.0;  ///< |dV/dq| along an axis, at these points

  /// Adds a reason: at the end, or before the reason with index `before`.
  void refuse(std::string_view cause, std::string text);
  void refuse(std::string_view cause, std::string text, std::size_t before);
};

/// Applies the conditions of this header to the candidate. Pure. `active` may be null. Points at
/// which magnitude and gradient of V are evaluated:
/// - tables: the tensor grid of the nodes (V is linear between them along each axis),
/// - polynomials: the vertices of the validity hull (each is a measured reading), the midpoints
///   between any two vertices, and the nodes inside the hull.
/// A model without any such point is refused.
[[nodiscard]] Verdict decide(const VolumetricModel& candidate, const HeldOutFigures&,
                             const GateLimits& = {}, const VolumetricModel* active = nullptr);

}  // namespace abbe::calib
