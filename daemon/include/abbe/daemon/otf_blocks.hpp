#pragma once
/// How many tracker samples make a block: about as many as the target needs for 8.3 mm, fine against nodes 50
/// mm apart and the length at which [Sanders 2023] was re-evaluated (100 samples at 500 Hz and 2500 mm/min).

#include <cstddef>
#include <span>

#include "abbe/calib/otf/run.hpp"

namespace abbe::daemon {

/// 10 to 1000. The travel is taken over chords of 50 samples, so that noise does not count as way, and from
/// their upper quartile, which standstill and ramps do not reach. Pure.
[[nodiscard]] std::size_t otf_block_samples(std::span<const calib::otf::TrackerObservation> points);

}  // namespace abbe::daemon
