#include <algorithm>
#include <cmath>

#include "abbe/calib/otf/blocks.hpp"

namespace abbe::calib::otf {

std::size_t suitable_block_samples(std::span<const TrackerObservation> samples) {
  constexpr double kBlockTravel_m = 8.33e-3;
  constexpr std::size_t kChord = 50;

  // the design rows of a block are averaged over ten sub-points
  constexpr std::size_t kSmallest = 10;
  constexpr std::size_t kLargest = 1000;
  std::vector<double> travel_m;  // per sample

  for (std::size_t i = kChord; i < samples.size(); i += kChord) {
    if (samples[i].valid && samples[i - kChord].valid) {
      travel_m.push_back((samples[i].p_tracker_m - samples[i - kChord].p_tracker_m).norm() /
                         double{kChord});
    }
  }

  if (travel_m.empty()) {
    return kSmallest;
  }

  const auto quartile = travel_m.begin() + static_cast<std::ptrdiff_t>(3 * travel_m.size() / 4);
  std::nth_element(travel_m.begin(), quartile, travel_m.end());
  if (!(*quartile * double{kLargest} > kBlockTravel_m)) {
    return kLargest;
  }

  return std::clamp(static_cast<std::size_t>(std::lround(kBlockTravel_m / *quartile)), kSmallest,
                    kLargest);
}

}  // namespace abbe::calib::otf
