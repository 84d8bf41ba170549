#include "samples/sample_windows.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::otf {
namespace {

/// Deviation of sample i from the middle of its neighbours; nullopt if one of them is lost.
std::optional<Vector3> off_neighbours_m(std::span<const TrackerObservation> samples,
                                        std::size_t i) {
  if (i == 0 || i + 1 >= samples.size() || !samples[i - 1].valid || !samples[i].valid ||
      !samples[i + 1].valid) {
    return std::nullopt;
  }
  return Vector3(samples[i].p_tracker_m -
                 0.5 * (samples[i - 1].p_tracker_m + samples[i + 1].p_tracker_m));
}

}  // namespace

SampleTimes sample_times(std::span<const TrackerObservation> samples) {
  constexpr double kPause_s = 1.0;      // a longer step is a break and not the step between bursts
  constexpr double kWithinBurst = 0.1;  // limit of a step within a burst, relative to the mean step
  SampleTimes times;
  std::vector<double> steps_s;
  steps_s.reserve(samples.size());
  double sum_s = 0.0;

  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double step_s = samples[i].time_s - samples[i - 1].time_s;
    if (step_s <= kPause_s || steps_s.empty()) {
      steps_s.push_back(step_s);
      sum_s += step_s;
    }
  }

  const double mean_s = sum_s / static_cast<double>(steps_s.size());
  const double median_s = median(steps_s);
  const bool by_delivery = median_s < kWithinBurst * mean_s;
  times.period_s = by_delivery ? mean_s : median_s;
  times.time_s.reserve(samples.size());
  times.time_s.push_back(samples.front().time_s);

  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double step_s = samples[i].time_s - samples[i - 1].time_s;
    times.time_s.push_back(!by_delivery        ? samples[i].time_s
                           : step_s > kPause_s ? times.time_s.back() + step_s
                                               : times.time_s.back() + mean_s);
  }

  return times;
}

double sample_noise_m(std::span<const TrackerObservation> samples) {
  constexpr double kOfDifference = 1.5;  // variance of p_i - (p_i-1 + p_i+1) / 2
  std::vector<double> off_m;
  for (std::size_t i = 1; i + 1 < samples.size(); ++i) {
    if (const auto off = off_neighbours_m(samples, i)) {
      for (Eigen::Index k = 0; k < 3; ++k) {
        off_m.push_back(std::abs((*off)(k)));
      }
    }
  }

  return off_m.empty() ? 0.0 : kMadToSigma * median(off_m) / std::sqrt(kOfDifference);
}

SampleWindows::SampleWindows(std::span<const TrackerObservation> samples, double sigma_m)
    : count_(samples.size() + 1, 0), sum_(samples.size() + 1, Vector3::Zero()) {
  constexpr double kFarOff = 15.0;        // in standard deviations; also excludes fast motion
  constexpr double kResolution_m = 1e-6;  // limit for a stream without noise
  const double limit_m = kFarOff * std::max(sigma_m, kResolution_m);
  const auto first_valid = std::find_if(samples.begin(), samples.end(),
                                        [](const TrackerObservation& s) { return s.valid; });
  const Vector3 origin =
      first_valid == samples.end() ? Vector3(Vector3::Zero()) : first_valid->p_tracker_m;

  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto off = off_neighbours_m(samples, i);
    const bool use = samples[i].valid && !(off && off->norm() > limit_m);
    count_[i + 1] = count_[i] + (use ? 1 : 0);
    sum_[i + 1] = sum_[i];
    if (use) {
      sum_[i + 1] += samples[i].p_tracker_m - origin;
    }
  }
}

}  // namespace abbe::calib::otf
