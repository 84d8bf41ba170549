#pragma once
/// What the residuals of a ball array show beyond noise. The estimate is compared with alternatives, each of
/// which adds a few columns C to y = X c + S omega + C d + noise, with d ~ N(0, (100 um)^2): a ball off its
/// place at one position or in the calibrator's file, the array moved, creeping or bent, the machine
/// drifting. Other designs (another axis order, polynomials of one order more) replace X. Alternatives are
/// compared by the marginal likelihood of y with their hyper-parameters fitted anew (prior.hpp): by how much
/// an alternative is more likely than the model alone bounds the probability of a false alarm. Touches are
/// compared with the spheres and planes of the others of their feature, after the model's V is taken out of
/// them. Not seen: whatever the model follows at all positions alike (length and temperature of the array, a
/// rotation common to all positions, a drift that is the same at every position).

#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/evemu/solve.hpp"

namespace abbe::calib::evemu {

enum class Cause {
  Touch,       ///< one touch off the others of its ball or face
  Form,        ///< touches of a ball or face scatter more than elsewhere: it moved while it was touched
  Backlash,    ///< touches depend on the side they come from
  Ball,        ///< a ball at one position
  ArrayFile,   ///< a ball in the calibrator's file
  Moved,       ///< the array within a position
  Creep,       ///< the array moves on at every position
  Bent,        ///< every position bends it anew
  Drift,       ///< of the machine, over the session
  ChainOrder,  ///< other axes carry each other
  Order,       ///< polynomials of one order more
  SlowNoise,   ///< within positions
  Scatter      ///< more than touches and array have, and none of the others
};
[[nodiscard]] std::string_view name(Cause);

struct Alternative {
  Cause cause;
  std::string text;             ///< what happened, where, how much, what to do
  double log_likelihood = 0.0;  ///< natural logarithm of how much more likely the data are with it
  double bias_m = 0.0;          ///< rms change of V over the balls, without rigid motion, that it brings
  double u_m = 0.0;             ///< rms standard uncertainty of V if it holds, without rigid motion
};

/// Root mean squares over the balls, without the best-fit rigid motion.
struct CorrectionSize {
  double V_m = 0.0;
  double u_m = 0.0;  ///< standard uncertainty of V: root of the trace
};
[[nodiscard]] CorrectionSize correction_size(const Observations&, const Solution&);

/// The significant ones (family-wise error probability 1e-4), the most likely first, but those that move the
/// model by less than a tenth of its uncertainty last; one of each cause.
[[nodiscard]] Result<std::vector<Alternative>> alternatives(const Observations&, const Solution&);

}  // namespace abbe::calib::evemu
