#pragma once
/// Reads the files of the options --tracker and --encoder of `abbe identify otf`, with the columns
/// of abbe or of other programs.

#include <cstddef>
#include <string>

#include "abbe/tasks/identify_otf.hpp"

namespace abbe::daemon {

/// Reads tracker.csv, or points that another program exported. `index`: index of the target, for
/// its --tracker-centre-mm. BadInput names missing options for exported points, or options that
/// tracker.csv does not need.
[[nodiscard]] Result<TrackerFile> read_tracker_points(const IdentifyOtfArguments& arguments,
                                                      const std::string& file, std::size_t index,
                                                      const ReadProgress& progress);

/// Reads encoder.csv, or a log of camonitor. Errors as for read_tracker_points().
[[nodiscard]] Result<EncoderFile> read_scale_readings(const IdentifyOtfArguments& arguments,
                                                      const ReadProgress& progress);

}  // namespace abbe::daemon
