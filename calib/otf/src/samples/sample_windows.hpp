#pragma once
/// Times of tracker samples, their noise, and means over windows of them.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

struct SampleTimes {
  std::vector<double> time_s;  ///< of every sample
  double period_s = 0.0;       ///< between two samples
};
/// Times as given. Those of a stream whose samples have the time of delivery of their burst are
/// replaced by equally spaced ones: there the steps within a burst are much shorter than the mean
/// step. Needs two samples.
[[nodiscard]] SampleTimes sample_times(std::span<const TrackerObservation>);

/// Standard deviation of one coordinate of a sample, from the median of the second differences of
/// three successive valid samples; 0 without such samples. Slow motion does not contribute.
[[nodiscard]] double sample_noise_m(std::span<const TrackerObservation>);

/// Means of valid samples over ranges of indices, by cumulative sums. Single samples far off their
/// two neighbours are left out.
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
  std::vector<std::size_t> count_;  ///< in use before sample i
  std::vector<Vector3> sum_;        ///< of their positions, relative to the first valid sample
};

}  // namespace abbe::calib::otf
