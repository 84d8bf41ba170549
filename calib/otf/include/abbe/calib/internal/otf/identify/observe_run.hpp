#pragma once
/// Computes the observations of a whole run in its mode, together with its visits of reference
/// nests. Pure.

#include <span>

#include "abbe/calib/internal/otf/observe/aligned_segments.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// Observations of aligned_segments() in on-the-fly mode; those of observe_standstills() in
/// standstill mode.
[[nodiscard]] Result<Observations> observe(std::span<const TrackerObservation>, const Machine&,
                                           const Path&, const Noise&, const Options& = {});
/// Observations in on-the-fly mode, from the segments of the run.
[[nodiscard]] Result<Observations> observe_with_nests(const AlignedSegments&, const Machine&,
                                                      const Path&, const Noise&, const Options&);

}  // namespace abbe::calib::otf
