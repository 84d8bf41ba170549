#pragma once
/// Result of the second step of aligned_segments(): samples off the line through their neighbours.

#include <span>
#include <vector>

#include "abbe/calib/otf/observe/alignment.hpp"
#include "abbe/calib/otf/observe/segments.hpp"

namespace abbe::calib::otf {

struct OffLine {
  std::vector<std::size_t> samples;  ///< indices of the samples, ascending
  struct Noisy {
    std::size_t segment = 0;
    double noise_factor = 1.0;
  };
  std::vector<Noisy> segments;
};
/// Finds the samples off the line through their neighbours. `series`: the segments of `samples`.
[[nodiscard]] OffLine off_line_samples(std::span<const TrackerObservation> samples,
                                       const SegmentSeries& series, const Alignment&,
                                       const Vector3& target_offset_m, const Path&, const Noise&);

}  // namespace abbe::calib::otf
