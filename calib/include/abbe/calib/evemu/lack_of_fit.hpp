#pragma once
/// What the residuals of a ball array show beyond noise. The estimate is compared with
/// alternatives, each of which adds a few columns C to y = X c + S omega + C d + noise, with d ~
/// N(0, t^2), t from 10 to 300 um: a ball off its place at one position or in the calibrator's
/// file, the array moved, creeping or bent, the machine drifting. Other designs (another axis
/// order, polynomials of one order more) replace X, slow noise (noise.hpp) the noise; where
/// bayes-pose estimated slow noise, all are compared without it. Alternatives are compared by the
/// marginal likelihood of y with their own hyper-parameters (prior.hpp): by how much an alternative
/// is more likely than the model alone bounds the probability of a false alarm. Touches are
/// compared with the spheres and planes of the others of their feature, after the model's V is
/// taken out of them. Not seen: whatever the model follows at all positions alike (length and
/// temperature of the array, a rotation common to all positions, a drift that is the same at every
/// position).

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/evemu/solve.hpp"

namespace abbe::calib::evemu {

enum class Cause {
  Touch,  ///< one touch off the others of its ball or face
  Form,   ///< touches of a ball or face scatter more than elsewhere: it moved while it was touched
  Backlash,    ///< touches depend on the side they come from
  Ball,        ///< a ball at one position
  ArrayFile,   ///< a ball in the calibrator's file
  Moved,       ///< the array within a position
  Creep,       ///< the array moves on at every position
  Bent,        ///< every position bends it differently
  Drift,       ///< of the machine, over the session
  ChainOrder,  ///< other axes carry each other
  Order,       ///< polynomials of one order more
  SlowNoise,   ///< within positions
  Scatter      ///< more than touches and array have, and none of the others
};
[[nodiscard]] std::string_view name(Cause);

/// Of its uncertainty: an alternative that moves the model by less hardly matters.
inline constexpr double kMatters = 0.1;

/// Of touches or ball centres, as a length in space (root of the trace). No touch tells a probe's
/// noise, which averages out in the model, from short waves of the machine, which the model does
/// not follow and which are left beside its u: u and 1.5 u together are 1.8 u.
inline constexpr double kScatterBesideU = 1.5;
/// Standard deviation of one touch along the normal, or of a ball centre per coordinate, that may
/// be a probe's, whatever u is: a touch trigger probe with its lobes.
inline constexpr double kScatterOfProbes_m = 3e-6;

/// Failed: the data cannot be compared with the alternative, which may hold. Impossible: the
/// alternative does not exist for these observations.
enum class Comparison { Made, Failed, Impossible };

struct Alternative {
  Cause cause;
  std::string
      text;  ///< what happened, where, how much, what to do; or what is not compared and why
  double log_likelihood = 0.0;  ///< natural logarithm of how much more likely the data are with it
  double bias_m = 0.0;  ///< rms change of V over the balls, without rigid motion, that it brings
  double u_m = 0.0;     ///< rms standard uncertainty of V if it holds, without rigid motion
  Comparison comparison = Comparison::Made;  ///< else the figures are NaN
};

/// Root mean squares over the balls, without the best-fit rigid motion.
struct CorrectionSize {
  double V_m = 0.0;
  double u_m = 0.0;  ///< standard uncertainty of V: root of the trace
};
[[nodiscard]] CorrectionSize correction_size(const Observations&, const Solution&);

/// Of a computation that takes long; both may be empty.
struct Watch {
  std::function<void(double fraction)>
      progress;  ///< called in the calling thread, ascending up to 1
  /// Asked in the calling thread, between two alternatives or fits. True ends the computation with
  /// NotConverged.
  std::function<bool()> stopped;
};

/// The significant ones (family-wise error probability 1e-4), the most likely first, but those that
/// move the model by less than a tenth of its uncertainty last; one of each cause, of scatter up to
/// two, behind the others. Then comparisons that were not made. The columns of one alternative at a
/// time are in memory. NotConverged where the estimate itself has no likelihood, or when stopped.
[[nodiscard]] Result<std::vector<Alternative>> alternatives(const Observations&, const Solution&,
                                                            const Watch& = {});

}  // namespace abbe::calib::evemu
