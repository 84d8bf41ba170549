#pragma once
/// The options of the tracker driver, the same for a live device and for its replay. Pure.

#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/config/kinds/tracker.hpp"
#include "abbe/drivers/lines/device.hpp"
#include "abbe/drivers/tracker/device.hpp"

namespace abbe::daemon {

/// Options for `config`. `speed`: host seconds per second; time-outs are multiplied by it, see
/// stretched().
[[nodiscard]] drivers::TrackerDeviceOptions device_options(const TrackerConfig& config,
                                                           double speed);

/// Same as device_options(), for a tracker that sends its points as lines of text.
[[nodiscard]] drivers::LineTrackerOptions line_options(const TrackerConfig& config, double speed);

/// The options from the text of the configuration table of a tracker that sends lines of text.
[[nodiscard]] Result<drivers::LineTrackerOptions> parse_line_options(std::string_view table);

}  // namespace abbe::daemon
