#pragma once
/// The steps of observe() before and after the alignment.

#include "abbe/calib/otf/aligned_blocks.hpp"
#include "abbe/calib/otf/observe.hpp"

namespace abbe::calib::otf {

/// BadInput if the travel of a block is longer than twice Options::corner_m: a block so long could
/// extend over a corner and still be used.
[[nodiscard]] Result<void> check_travel(const BlockSeries&, const Options&);

/// observe_blocks() from blocks whose alignment is known.
[[nodiscard]] Result<Observations> observe_aligned(const BlockSeries&, Alignment, const Machine&,
                                                   const Path&, const Noise&, const Options&);

/// The same from the blocks of a run, with its visits of nests (drift_observations.hpp).
[[nodiscard]] Result<Observations> observe_with_nests(const AlignedBlocks&, const Machine&,
                                                      const Path&, const Noise&, const Options&);

}  // namespace abbe::calib::otf
