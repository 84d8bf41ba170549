#pragma once

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

/// One sentence for each feature of a pass whose touches fit much worse than those of the same kind
/// usually do: more than 5 times the median of their residuals. The touches of all passes can be
/// fitted (observe() did it).
[[nodiscard]] std::vector<std::string> outlying_features(const Bar&, const Plan&,
                                                         std::span<const PassTouches>);

}  // namespace abbe::calib::mfb
