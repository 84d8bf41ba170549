#pragma once
/// The estimate with scale readings (along_rows.hpp). The rows along the travel are judged by their
/// own residuals. If these are larger than the stated uncertainties allow, the uncertainties of
/// these rows are multiplied; far larger ones are not used. So readings whose times are worse than
/// stated do not change what the rows across the travel determine.

#include <functional>

#include "abbe/calib/internal/otf/observe/along_rows.hpp"
#include "abbe/calib/otf/identify/identify.hpp"

namespace abbe::calib::otf {

/// `estimate`: the solution with these rows along the travel, or without (null). Errors of
/// check(EncoderLog) and `estimate`; BadInput for segments without times; AlignmentFailed if the
/// readings are not those of this run.
[[nodiscard]] Result<Identification> identify_synchronised(
    const Observations& across, const SegmentSeries&, const Noise&, const Options&,
    const std::function<Result<Identification>(AlongRows*)>& estimate);

}  // namespace abbe::calib::otf
