#pragma once
/// The temperature of the bar beside that of its calibration, 20 degC.

#include <optional>
#include <string>

#include "abbe/calib/mfb/observe.hpp"

namespace abbe::calib::mfb {

/// "X1: the temperature of the bar is 68.9 C, 48.9 K from that of its calibration: all lengths change
/// by 562 um/m", of the pass farthest from 20 C; nullopt: within kMostFromReference_K.
[[nodiscard]] std::optional<std::string> bar_far_from_reference(const Observations&);

}  // namespace abbe::calib::mfb
