#pragma once
/// Means of consecutive tracker samples. A mean is the mean of the machine's path over the block,
/// not the path at the mean: whatever a block is compared with has to be averaged over the same
/// sub-points.

#include <span>
#include <vector>

#include "abbe/calib/otf/run.hpp"

namespace abbe::calib::otf {

struct Block {
  Vector3 mean_tracker_m = Vector3::Zero();
  /// valid samples in the mean; 0: the beam was lost, the block only keeps time
  std::size_t samples = 0;
  bool usable = false;  ///< at least half of the samples are there: fit for the adjustment
  /// into BlockSeries::sub_points_tracker_m, Options::row_points of them
  std::size_t first_sub_point = 0;
};

/// Blocks in the order of time, equally long.
struct BlockSeries {
  std::vector<Block> blocks;
  std::vector<Vector3> sub_points_tracker_m;  ///< evenly spread valid samples of every usable block
  std::size_t sub_points = 0;                 ///< per block
  Vector3 start_tracker_m = Vector3::Zero();  ///< mean of the standstill at the first vertex
  Vector3 end_tracker_m = Vector3::Zero();
  std::size_t samples = 0;
  std::size_t lost_samples = 0;  ///< invalid or missing in time
};

/// Samples to a block so that the target travels 8.3 mm in it: fine against nodes 50 mm apart, and
/// the length at which [Sanders 2023] was re-evaluated (100 samples at 500 Hz and 2500 mm/min). 10
/// to 1000. The travel is taken over chords of 50 samples, so that noise does not count as way, and
/// from their upper quartile, which standstill and ramps do not reach.
[[nodiscard]] std::size_t suitable_block_samples(std::span<const TrackerObservation>);

/// NotFinite for NaN in a valid sample (says which), BadInput for time that does not ascend,
/// TooFewObservations below four blocks or without standstill samples.
[[nodiscard]] Result<BlockSeries> make_blocks(std::span<const TrackerObservation>, const Options&);

/// From means alone (a reduced recording): sub-points are spread along the direction of travel.
[[nodiscard]] Result<BlockSeries> blocks_from_means(std::span<const Vector3> means_tracker_m,
                                                    const Vector3& start_tracker_m,
                                                    const Vector3& end_tracker_m, const Options&);

}  // namespace abbe::calib::otf
