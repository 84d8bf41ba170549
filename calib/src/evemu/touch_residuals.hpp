#pragma once
/// Touches against the spheres and planes of the others of their feature, once V of a model is
/// taken out of them: what is left is the probe's, or a fault.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "abbe/calib/evemu/lack_of_fit.hpp"

namespace abbe::calib::evemu {

/// A significant one.
struct TouchFinding {
  Cause cause = Cause::Touch;
  std::string text;
  double log_likelihood = 0.0;
  Eigen::VectorXd rows_m;  ///< what it does to the errors seen, 3 rows.size(); empty: not computed
};

struct TouchResiduals {
  /// of one touch along the normal; from the median, which faults do not move
  double sigma_m = 0.0;
  double sigma_of_no_cause_m = 0.0;  ///< the same without the backlash that was found
  double s_centre_m = 0.0;  ///< of a ball's centre per coordinate that follows, root mean square
  std::vector<TouchFinding> findings;
  std::vector<std::string> failed;  ///< "position 3, ball 4": no surface or no finite residuals
  std::string not_compared;         ///< why none was compared; else empty
};
/// `false_alarm`: family-wise probability. Needs touches (Observations::seen).
[[nodiscard]] TouchResiduals touch_residuals(const Observations&, const VolumetricModel&,
                                             double false_alarm);

}  // namespace abbe::calib::evemu
