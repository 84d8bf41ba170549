#pragma once
/// First estimate of the offset and the drift of two clocks: the offset for which the scale
/// readings lie nearest to the tracker's points.

#include <vector>

#include "abbe/calib/internal/otf/observe/along_rows.hpp"

namespace abbe::calib::otf {

/// The scale readings fit the points within a fraction of a millimetre, or AlignmentFailed; the
/// text names reversed or swapped axes and other units of length that would fit. A known clock is
/// only checked.
[[nodiscard]] Result<RunClock> match_clocks(const EncoderLog&, const Observations& across,
                                            const SegmentSeries&);

}  // namespace abbe::calib::otf
