#pragma once
/// Requirement on the uncertainty of a model, common to all identification methods.

#include <cmath>
#include <string>
#include <string_view>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/model/gate.hpp"

namespace abbe::calib {

/// Largest permitted ratio of the standard uncertainty of the correction to the correction, both
/// rms. One half: even if the error of the correction is twice its standard uncertainty, the
/// residual error is not larger than the uncorrected error.
inline constexpr double kMostUncertainty = 0.5;

/// Entry in Verdict::causes.
inline constexpr std::string_view kUncertain = "uncertainty";

/// Refuses the model if u_m > kMostUncertainty * V_m or if u_m or V_m is NaN. V_m, u_m: rms of V
/// and of its standard uncertainty, rigid motion removed.
inline void require_certainty(Verdict& verdict, double V_m, double u_m) {
  if (!(u_m <= kMostUncertainty * V_m)) {
    verdict.refuse(kUncertain,
                   message("the correction is ", 1e6 * V_m, " um rms, its standard uncertainty ",
                           1e6 * u_m, " um: more than half of it"));
  }
}

/// Appends the effect on the model to the text of a cause, such as "the axes have backlash: it
/// changes the model by 12 um rms, the uncertainty is 2 um".
inline std::string with_effect(const std::string& cause, double bias_m, double u_m) {
  if (std::isnan(bias_m)) {
    return cause;  // the effect on the model is not known
  }
  return message(cause, ": it changes the model by ", 1e6 * bias_m, " um rms, the uncertainty is ",
                 1e6 * u_m, " um");
}

}  // namespace abbe::calib
