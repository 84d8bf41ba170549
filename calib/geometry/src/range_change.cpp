#include "abbe/calib/internal/geometry/range_change.hpp"

#include <array>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib {

Vector3 with_longer_range(const Vector3& p_tracker_m, double longer_m) {
  const double range_m = p_tracker_m.norm();
  return range_m > 0.0 ? Vector3(p_tracker_m * (1.0 + longer_m / range_m)) : p_tracker_m;
}

std::optional<double> best_range_change_m(
    const std::function<std::optional<double>(double change_m)>& rms_m) {
  constexpr double kMost_m = 60e-3;
  double change_m = 0.0;
  for (const double step_m : {5e-3, 2e-3, 0.5e-3, 0.1e-3}) {
    const auto below = rms_m(change_m - step_m), here = rms_m(change_m),
               above = rms_m(change_m + step_m);
    if (!below || !here || !above) {
      return std::nullopt;
    }
    const double slope = *above * *above - *below * *below;
    const double curvature = *above * *above - 2.0 * *here * *here + *below * *below;
    if (!(curvature > 0.0)) {
      return std::nullopt;
    }
    change_m -= 0.5 * step_m * slope / curvature;
    if (!(std::abs(change_m) <= kMost_m)) {
      return std::nullopt;
    }
  }
  return change_m;
}

std::string range_change_text(double change_m) {
  const double hundredths = std::round(1e5 * std::abs(change_m));
  return message("ranges ", change_m < 0.0 ? "shorter" : "longer", " by ", hundredths / 100.0,
                 " mm (radius of the reflector, or home position of the tracker)");
}

std::span<const double> reflector_radii_m() {
  static constexpr std::array<double, 3> kRadii{19.05e-3, 11.1125e-3, 6.35e-3};
  return kRadii;
}

}  // namespace abbe::calib
