#pragma once

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

/// Returns one sentence for each feature of a pass whose touches fit much worse than those of its
/// kind: more than 5 times the median of their residuals. The touches of all passes must have
/// passed observe().
[[nodiscard]] std::vector<std::string> outlying_features(const Bar&, const Plan&,
                                                         std::span<const PassTouches>);

}  // namespace abbe::calib::mfb
