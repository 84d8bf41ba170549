#pragma once
/// The options of the tracker driver. A live device and its replay use the same ones. Pure.

#include "abbe/config/kinds/tracker.hpp"
#include "abbe/drivers/tracker/device.hpp"

namespace abbe::daemon {

/// Time-outs are multiplied by `speed`; see stretched().
[[nodiscard]] drivers::TrackerDeviceOptions device_options(const TrackerConfig& config,
                                                           double speed);

}  // namespace abbe::daemon
