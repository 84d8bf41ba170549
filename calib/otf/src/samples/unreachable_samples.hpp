#pragma once
/// First step of aligned_segments(): samples that the target cannot have reached.

#include <span>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// True for each sample that is excluded; empty if there is none. Times ascend.
[[nodiscard]] std::vector<bool> unreachable_samples(std::span<const TrackerObservation>);

}  // namespace abbe::calib::otf
