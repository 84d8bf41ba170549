#pragma once
/// Finds temperatures of the bar that are not plausible. The residuals do not reveal a temperature
/// that is wrong by the same amount at all positions. They also do not reveal a wrong temperature
/// at a position that alone determines an error.

#include <optional>
#include <string>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// Text for the pass farthest from 20 C, such as "X1: the temperature of the bar is 68.9 C, 48.9 K
/// from that of its calibration: all lengths change by 562 um/m". nullopt: all are within
/// kMostFromReference_K.
[[nodiscard]] std::optional<std::string> bar_far_from_reference(const Observations&);

/// Text for the position that differs most, such as "X1: the temperature of the bar is 25.1 C, 4.2
/// K from that of the positions next to it: its lengths change by 48 um/m". nullopt if no position
/// differs from both positions next to it in time, in the same direction, by more than
/// kMostBetweenPositions_K and three times the uncertainty of its temperature. The first and the
/// last position are compared with the next two, if these agree.
[[nodiscard]] std::optional<std::string> bar_unlike_neighbours(const Observations&);

}  // namespace abbe::calib::mfb
