#pragma once
/// Search for a single false touch on a ball or face, by the residuals of the touches to the fitted
/// surface.

#include <optional>
#include <vector>

#include "abbe/calib/internal/evemu/judge/touch_residuals.hpp"
#include "observe/feature_residuals.hpp"

namespace abbe::calib::evemu {

/// The touch with the most significant residual, provided that the other touches of its feature fit
/// one surface. The text names the touch; if the feature has too few touches to decide which of
/// them is false, it names only the feature. `false_alarm`: probability over all touches.
[[nodiscard]] std::optional<TouchFinding> false_touch(const Observations&,
                                                      const std::vector<FeatureResiduals>&,
                                                      double sigma_m, double false_alarm);

}  // namespace abbe::calib::evemu
