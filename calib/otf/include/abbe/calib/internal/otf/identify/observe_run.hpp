#pragma once
/// Observations of a whole run: of its mode, with its visits of reference nests. Pure.

#include <span>

#include "abbe/calib/internal/otf/observe/aligned_segments.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// On the fly: observations of aligned_segments(); in standstill mode those of
/// observe_standstills().
[[nodiscard]] Result<Observations> observe(std::span<const TrackerObservation>, const Machine&,
                                           const Path&, const Noise&, const Options& = {});
/// The same on the fly, from the segments of the run.
[[nodiscard]] Result<Observations> observe_with_nests(const AlignedSegments&, const Machine&,
                                                      const Path&, const Noise&, const Options&);

}  // namespace abbe::calib::otf
