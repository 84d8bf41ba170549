#pragma once
/// --tracker and --encoder of `abbe identify otf`: files with the columns of abbe, or of other
/// programs.

#include <cstddef>
#include <string>

#include "abbe/tasks/identify_otf.hpp"

namespace abbe::daemon {

/// tracker.csv, or points that another program exported. `index`: of the target, for its
/// --tracker-centre-mm. BadInput with what is missing for exported points, or for options that
/// tracker.csv does not need.
[[nodiscard]] Result<TrackerFile> read_tracker_points(const IdentifyOtfArguments& arguments,
                                                      const std::string& file, std::size_t index,
                                                      const ReadProgress& progress);

/// encoder.csv, or a log of camonitor; likewise.
[[nodiscard]] Result<EncoderFile> read_scale_readings(const IdentifyOtfArguments& arguments,
                                                      const ReadProgress& progress);

}  // namespace abbe::daemon
