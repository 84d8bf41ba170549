#pragma once
/// The steps of observe() before and after the alignment.

#include "abbe/calib/internal/otf/observe/aligned_blocks.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// BadInput if the travel of a block is longer than twice Options::corner_m: a block so long could
/// extend over a corner and still be used.
[[nodiscard]] Result<void> check_travel(const BlockSeries&, const Options&);

/// observe_blocks() from blocks whose alignment is known.
[[nodiscard]] Result<Observations> observe_aligned(const BlockSeries&, Alignment, const Machine&,
                                                   const Path&, const Noise&, const Options&);

}  // namespace abbe::calib::otf
