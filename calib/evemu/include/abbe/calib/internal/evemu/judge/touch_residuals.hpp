#pragma once
/// Residuals of touches to the fitted spheres and planes of balls and faces, after the V of a model
/// is removed. These residuals contain the noise of the probe and the effects of faults.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "abbe/calib/evemu/judge/lack_of_fit.hpp"

namespace abbe::calib::evemu {

/// A cause of lack of fit that the residuals of the touches show significantly.
struct TouchFinding {
  Cause cause = Cause::Touch;
  std::string text;
  double log_likelihood = 0.0;
  Eigen::VectorXd rows_m;  ///< effect on the observed errors, 3 rows.size(); empty: not computed
};

struct TouchResiduals {
  /// standard deviation of one touch along the normal; from the median, so robust against faults
  double sigma_m = 0.0;
  double sigma_of_no_cause_m = 0.0;  ///< sigma_m after removal of the backlash that was found
  /// standard deviation of a ball centre per coordinate that follows from sigma_m, rms over balls
  double s_centre_m = 0.0;
  std::vector<TouchFinding> findings;
  std::vector<std::string> failed;  ///< places such as "position 3, ball 4": no surface or no
                                    ///< finite residuals
  std::string not_compared;         ///< why no touch was compared; else empty
};
/// Computes the residuals and the findings. `false_alarm`: family-wise probability. Needs touches
/// (Observations::seen).
[[nodiscard]] TouchResiduals touch_residuals(const Observations&, const VolumetricModel&,
                                             double false_alarm);

}  // namespace abbe::calib::evemu
