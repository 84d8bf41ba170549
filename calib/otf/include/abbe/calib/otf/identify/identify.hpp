#pragma once
/// Result of an identification with Options::estimator: observe() followed by solve(). For
/// Estimator::Simultaneous the observations are linearised at the solution in between
/// (simultaneous.hpp), and correlated noise is prewhitened afterwards (prewhitening.hpp). judge()
/// is separate because it needs the active model and the limits.

#include "abbe/calib/otf/judge/judge.hpp"

namespace abbe::calib::otf {

struct Identification {
  Observations observations;
  Solution solution;
};
/// Identifies the errors of a run. Pure and deterministic: the same input gives bit-identical
/// results.
[[nodiscard]] Result<Identification> identify(std::span<const TrackerObservation>, const Machine&,
                                              const Path&, const Noise&, const Options& = {});
/// Identifies the errors from segments that are already averaged.
[[nodiscard]] Result<Identification> identify_segments(const SegmentSeries&, const Machine&,
                                                       const Path&, const Noise&,
                                                       const Options& = {});

}  // namespace abbe::calib::otf
