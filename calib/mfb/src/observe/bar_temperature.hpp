#pragma once
/// Temperatures of the bar that are not plausible. No residual shows one that is wrong at all
/// positions alike, nor one at a position without which an error is not determined.

#include <optional>
#include <string>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// "X1: the temperature of the bar is 68.9 C, 48.9 K from that of its calibration: all lengths
/// change by 562 um/m", of the pass farthest from 20 C; nullopt: within kMostFromReference_K.
[[nodiscard]] std::optional<std::string> bar_far_from_reference(const Observations&);

/// "X1: the temperature of the bar is 25.1 C, 4.2 K from that of the positions next to it: its
/// lengths change by 48 um/m", of the position that differs most; nullopt: none differs from both
/// positions next to it in time in the same direction by more than kMostBetweenPositions_K and
/// three times the uncertainty of its temperature. At the ends it is compared with the next two, if
/// these agree.
[[nodiscard]] std::optional<std::string> bar_unlike_neighbours(const Observations&);

}  // namespace abbe::calib::mfb
