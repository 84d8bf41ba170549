#pragma once
/// What the gates of all methods ask of the uncertainty.

#include <cmath>
#include <string>
#include <string_view>

#include "abbe/calib/gate.hpp"
#include "message.hpp"

namespace abbe::calib {

/// Half: what is left by a correction whose error is twice its uncertainty is not larger than the
/// correction.
inline constexpr double kMostUncertainty = 0.5;

/// Of Verdict::causes.
inline constexpr std::string_view kUncertain = "uncertainty";

/// Root mean squares of V and its standard uncertainty, without rigid motion. NaN is refused.
inline void require_certainty(Verdict& verdict, double V_m, double u_m) {
  if (!(u_m <= kMostUncertainty * V_m)) {
    verdict.refuse(kUncertain,
                   message("the correction is ", 1e6 * V_m, " um rms, its standard uncertainty ",
                           1e6 * u_m, " um: more than half of it"));
  }
}

/// "the axes have backlash: it moves the model by 12 um rms, beside an uncertainty of 2 um".
inline std::string with_effect(const std::string& cause, double bias_m, double u_m) {
  if (std::isnan(bias_m)) {
    return cause;  // its effect is not known
  }
  return message(cause, ": it moves the model by ", 1e6 * bias_m,
                 " um rms, beside an uncertainty of ", 1e6 * u_m, " um");
}

}  // namespace abbe::calib
