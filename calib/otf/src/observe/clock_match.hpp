#pragma once
/// First estimate of offset and drift of the two clocks: the offset for which the scale readings
/// are closest to the tracker's points.

#include <vector>

#include "abbe/calib/internal/otf/observe/along_rows.hpp"

namespace abbe::calib::otf {

/// Computes the estimate; a known clock is only checked. AlignmentFailed unless the scale readings
/// then fit the points within a fraction of a millimetre; the text names reversed or swapped axes
/// and other units of length that would fit.
[[nodiscard]] Result<RunClock> match_clocks(const EncoderLog&, const Observations& across,
                                            const SegmentSeries&);

}  // namespace abbe::calib::otf
