#pragma once
/// First step of aligned_segments(): finds samples that the target cannot have reached.

#include <span>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// For each sample true if it is excluded; empty if none is excluded. Times must ascend.
[[nodiscard]] std::vector<bool> unreachable_samples(std::span<const TrackerObservation>);

}  // namespace abbe::calib::otf
