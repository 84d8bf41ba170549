#pragma once
/// The steps of observe() before and after the alignment.

#include "abbe/calib/internal/otf/observe/aligned_segments.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// BadInput if the travel of a segment is longer than twice Options::corner_m: a segment so long
/// could extend over a corner and still be used.
[[nodiscard]] Result<void> check_travel(const SegmentSeries&, const Options&);

/// observe_segments() from segments whose alignment is known.
[[nodiscard]] Result<Observations> observe_aligned(const SegmentSeries&, Alignment, const Machine&,
                                                   const Path&, const Noise&, const Options&);

}  // namespace abbe::calib::otf
