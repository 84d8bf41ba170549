#pragma once
/// A single false touch among those of one feature, found by the residuals of its surface.

#include <optional>
#include <vector>

#include "evemu/feature_residuals.hpp"
#include "evemu/touch_residuals.hpp"

namespace abbe::calib::evemu {

/// The most significant single touch, provided the others of its feature fit without it. The text
/// names the touch; if its feature has too few to find which one is false, only the feature.
/// `false_alarm`: probability over all touches.
[[nodiscard]] std::optional<TouchFinding> false_touch(const Observations&,
                                                      const std::vector<FeatureResiduals>&,
                                                      double sigma_m, double false_alarm);

}  // namespace abbe::calib::evemu
