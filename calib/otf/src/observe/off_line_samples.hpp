#pragma once
/// Second step of aligned_blocks(): samples off the line through their neighbours.

#include <span>
#include <vector>

#include "abbe/calib/otf/observe/alignment.hpp"
#include "abbe/calib/otf/observe/blocks.hpp"

namespace abbe::calib::otf {

struct OffLine {
  std::vector<std::size_t> samples;  ///< indices, ascending
  struct Noisy {
    std::size_t block = 0;
    double noise_factor = 1.0;
  };
  std::vector<Noisy> blocks;
};
/// `series`: blocks of `samples`.
[[nodiscard]] OffLine off_line_samples(std::span<const TrackerObservation> samples,
                                       const BlockSeries& series, const Alignment&,
                                       const Vector3& target_offset_m, const Path&, const Noise&);

}  // namespace abbe::calib::otf
