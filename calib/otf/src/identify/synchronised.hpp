#pragma once
/// The estimate with scale readings (along_rows.hpp). The rows along the travel are tested with
/// their own residuals. If these are larger than the stated uncertainties permit, the uncertainties
/// of these rows are multiplied by a factor; if they are much larger, the rows are not used.
/// Readings whose times are worse than stated therefore do not change the result of the rows across
/// the travel.

#include <functional>

#include "abbe/calib/internal/otf/observe/along_rows.hpp"
#include "abbe/calib/otf/identify/identify.hpp"

namespace abbe::calib::otf {

/// Identifies with scale readings. `estimate`: computes the solution with these rows along the
/// travel, or without them (null). Errors of check(EncoderLog) and `estimate`; BadInput for
/// segments without times; AlignmentFailed if the readings do not belong to this run.
[[nodiscard]] Result<Identification> identify_synchronised(
    const Observations& across, const SegmentSeries&, const Noise&, const Options&,
    const std::function<Result<Identification>(AlongRows*)>& estimate);

}  // namespace abbe::calib::otf
