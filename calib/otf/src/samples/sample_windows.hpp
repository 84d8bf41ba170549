#pragma once
/// Times of the samples of a tracker.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

struct SampleTimes {
  std::vector<double> time_s;  ///< time of each sample
  double period_s = 0.0;       ///< time between two samples
};
/// Returns the times of the samples. In some streams all samples of a burst have the time of its
/// delivery, so that the steps within a burst are much shorter than the mean step. Such times are
/// replaced by equally spaced ones. Needs two samples.
[[nodiscard]] SampleTimes sample_times(std::span<const TrackerObservation>);

/// Standard deviation of one coordinate of a sample, from the median of the second differences of
/// three successive valid samples; 0 without such samples. Slow motion does not contribute.
[[nodiscard]] double sample_noise_m(std::span<const TrackerObservation>);

/// Means of valid samples over ranges of indices, computed with cumulative sums. Single samples far
/// from their two neighbours are left out; all others are "in use".
class SampleWindows {
 public:
  SampleWindows(std::span<const TrackerObservation>, double sigma_m);

  [[nodiscard]] bool in_use(std::size_t i) const { return count_[i + 1] > count_[i]; }
  /// Number of samples in use in [begin, end).
  [[nodiscard]] std::size_t count(std::size_t begin, std::size_t end) const {
    return count_[end] - count_[begin];
  }
  /// Mean of the samples in use in [begin, end); at least one of them must be in use.
  [[nodiscard]] Vector3 mean_m(std::size_t begin, std::size_t end) const {
    return (sum_[end] - sum_[begin]) / static_cast<double>(count(begin, end));
  }

 private:
  std::vector<std::size_t> count_;  ///< number of samples in use before sample i
  std::vector<Vector3> sum_;        ///< sum of their positions, relative to the first valid sample
};

}  // namespace abbe::calib::otf
