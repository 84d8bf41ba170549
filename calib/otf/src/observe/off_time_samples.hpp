#pragma once
/// Finds samples that are wrong along the direction of travel, for the rows along the travel
/// (along_rows.hpp). Across the travel a sample is compared with the line through its neighbours
/// (off_line_samples.hpp). Along the travel its correct place follows only from time, and only at
/// constant speed.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/otf/observe/alignment.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Indices of the wrong samples, ascending. The distance along the leg of a sample is compared with
/// a line against time: repeated medians through its neighbours. A sample is wrong if it deviates
/// by seven standard deviations. Standard deviation: the largest of the stated one, that of the
/// run, and that around the line. Segments whose speed differs from that of their leg by more than
/// 2 % are not tested.
[[nodiscard]] std::vector<std::size_t> off_time_samples(std::span<const TrackerObservation>,
                                                        const SegmentSeries&, const Alignment&,
                                                        const Path&, const Noise&);

}  // namespace abbe::calib::otf
