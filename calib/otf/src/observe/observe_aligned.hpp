#pragma once
/// The steps of observe() before and after the alignment.

#include "abbe/calib/internal/otf/observe/aligned_segments.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// BadInput if a segment travels further than twice Options::corner_m: such a segment could extend
/// over a corner and still be used.
[[nodiscard]] Result<void> check_travel(const SegmentSeries&, const Options&);

/// observe_segments() from segments whose alignment is known.
[[nodiscard]] Result<Observations> observe_aligned(const SegmentSeries&, Alignment, const Machine&,
                                                   const Path&, const Noise&, const Options&);

}  // namespace abbe::calib::otf
