#pragma once
/// The options of the driver of axis positions as lines, the same for a live device and for its
/// replay. Pure.

#include "abbe/config/kinds/axis_lines.hpp"
#include "abbe/drivers/lines/device.hpp"

namespace abbe::daemon {

/// Options for `config`. `speed`: host seconds per second; time-outs are multiplied by it, see
/// stretched().
[[nodiscard]] drivers::LineAxesOptions line_options(const AxisLinesConfig& config, double speed);

}  // namespace abbe::daemon
