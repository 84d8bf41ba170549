#pragma once
/// Searches the residuals of a ball array for effects that are not noise. The estimate is compared
/// with alternatives. Most alternatives add a few columns C:
///     y = X c + S omega + C d + noise,    d ~ N(0, t^2),  t from 10 to 300 um,
/// y: observed errors, X c: the model, S omega: random rotations of the array at each position.
/// With them an alternative describes a ball displaced at one position or wrong in the calibrator
/// file, an array that moved, creeps or is bent, or a machine that drifts. Other alternatives
/// replace X (another order of the axes, polynomials of one order more) or the noise (slow noise,
/// noise.hpp). If the estimator bayes-pose has estimated slow noise, all alternatives are compared
/// with an estimate without slow noise. Alternatives are compared by the marginal likelihood of y
/// with their own hyper-parameters (prior.hpp): the likelihood ratio to the model alone bounds the
/// probability of a false alarm. In addition each touch is compared with the sphere or plane
/// through the other touches of its feature, after the V of the model is removed. Not detected:
/// every effect that the model follows at all positions alike (length and temperature of the array,
/// a rotation common to all positions, a drift that is the same at every position).

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/evemu/solve/solve.hpp"

namespace abbe::calib::evemu {

enum class Cause {
  Touch,       ///< one touch lies off the surface through the other touches of its ball or face
  Form,        ///< touches of one ball or face scatter more than those of others (motion, dirt)
  Backlash,    ///< touches depend on the direction of approach
  Ball,        ///< a ball is displaced at one position
  ArrayFile,   ///< the position of a ball in the calibrator file is wrong
  Moved,       ///< the array moved within a position
  Creep,       ///< the array moves gradually at every position
  Bent,        ///< the array is bent differently at every position
  Drift,       ///< the machine drifts during the session
  ChainOrder,  ///< the order of the axes is not that of the configured chain
  Order,       ///< polynomials of one order more describe the errors better
  SlowNoise,   ///< touches that follow each other have common noise
  Scatter      ///< more scatter than touches and array explain, without any other cause
};
[[nodiscard]] std::string_view name(Cause);

/// An alternative is minor if it changes the model by less than this fraction of the model's
/// uncertainty.
inline constexpr double kMatters = 0.1;

/// Largest accepted scatter of touches or ball centres, in units of the model's standard
/// uncertainty u; both are lengths in space (root of the trace). Touches cannot distinguish noise
/// of the probe, which averages out in the model, from short-wave errors of the machine, which the
/// model does not follow. If all of the scatter is short-wave errors, they remain in addition to u:
/// the root sum of squares of u and 1.5 u is 1.8 u.
inline constexpr double kScatterBesideU = 1.5;
/// Scatter up to this value is attributed to the probe, whatever the model's uncertainty is:
/// standard deviation of one touch along the normal, or of a ball centre per coordinate. A
/// touch-trigger probe with lobing scatters this much.
inline constexpr double kScatterOfProbes_m = 3e-6;

/// Failed: the comparison could not be computed; the alternative may be true. Impossible: the
/// alternative does not exist for these observations.
enum class Comparison { Made, Failed, Impossible };

struct Alternative {
  Cause cause;
  std::string
      text;  ///< description: what happened, where, how much, what to do; or what was not compared
             ///< and why
  double log_likelihood = 0.0;  ///< natural logarithm of the likelihood ratio to the model alone
  double bias_m = 0.0;  ///< rms change of V by the alternative over the balls, rigid motion removed
  double u_m = 0.0;     ///< rms u of V if the alternative is true, rigid motion removed
  Comparison comparison = Comparison::Made;  ///< unless Made, the figures are NaN
};

/// Size of the correction by a model and of its uncertainty: root mean squares over the balls,
/// without the best-fit rigid motion.
struct CorrectionSize {
  double V_m = 0.0;
  double u_m = 0.0;  ///< standard uncertainty of V without misfit: root of the trace
};
[[nodiscard]] CorrectionSize correction_size(const Observations&, const Solution&);

/// Callbacks of a long computation; both may be empty.
struct Watch {
  std::function<void(double fraction)>
      progress;  ///< called in the calling thread, with ascending values up to 1
  /// Called in the calling thread between two alternatives or fits. If it returns true, the
  /// computation ends with NotConverged.
  std::function<bool()> stopped;
};

/// Returns the significant alternatives, the most likely first: family-wise error probability 1e-4,
/// and 1e-2 for alternatives that change the model by more than twice its uncertainty. Alternatives
/// that change the model by less than a tenth of its uncertainty come after the others. At most one
/// alternative of each cause is returned; of Scatter up to two, after the others. The comparisons
/// that were not made come last. Only the columns of one alternative at a time are in memory.
/// NotConverged if the likelihood of the estimate itself cannot be computed, or when stopped.
[[nodiscard]] Result<std::vector<Alternative>> alternatives(const Observations&, const Solution&,
                                                            const Watch& = {});

}  // namespace abbe::calib::evemu
