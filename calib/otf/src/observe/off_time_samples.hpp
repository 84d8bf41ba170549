#pragma once
/// Samples that are wrong along the direction of travel. Across the travel a sample is compared
/// with the line through its neighbours (off_line_samples.hpp); along it only time shows where it
/// should be, and only where the speed is constant. The rows along the travel (along_rows.hpp) need
/// this.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/otf/observe/alignment.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Indices of the samples whose distance along their leg is off the line of repeated medians
/// through those of the neighbours against time, by seven standard deviations; ascending. Standard
/// deviation: the largest of the stated one, that of the run, and that around the line. Segments
/// whose speed differs from that of their leg by more than 2 % are not looked at.
[[nodiscard]] std::vector<std::size_t> off_time_samples(std::span<const TrackerObservation>,
                                                        const SegmentSeries&, const Alignment&,
                                                        const Path&, const Noise&);

}  // namespace abbe::calib::otf
