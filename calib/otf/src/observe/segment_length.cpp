#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "abbe/calib/otf/observe/segments.hpp"

namespace abbe::calib::otf {
namespace {

/// Upper quartile of the travel per sample, from chords over `chord` samples; nullopt: no chord.
std::optional<double> travel_per_sample_m(std::span<const TrackerObservation> samples,
                                          std::size_t chord) {
  std::vector<double> travel_m;
  for (std::size_t i = chord; i < samples.size(); i += chord) {
    if (samples[i].valid && samples[i - chord].valid) {
      travel_m.push_back((samples[i].p_tracker_m - samples[i - chord].p_tracker_m).norm() /
                         static_cast<double>(chord));
    }
  }

  if (travel_m.empty()) {
    return std::nullopt;
  }

  const auto quartile = travel_m.begin() + static_cast<std::ptrdiff_t>(3 * travel_m.size() / 4);
  std::nth_element(travel_m.begin(), quartile, travel_m.end());
  return *quartile;
}

}  // namespace

std::size_t suitable_segment_samples(std::span<const TrackerObservation> samples) {
  constexpr std::size_t kUnknownTravel = 10;
  std::size_t chord = 50;
  std::optional<double> travel_m = travel_per_sample_m(samples, chord);

  // With a low sample rate, a chord over many samples would be longer than a segment and cut the
  // corners of the path.
  while (chord > 1 && travel_m && *travel_m * static_cast<double>(chord) > kSegmentTravel_m) {
    chord = std::max<std::size_t>(1, chord / 5);
    travel_m = travel_per_sample_m(samples, chord);
  }

  if (!travel_m) {
    return kUnknownTravel;
  }

  return segment_samples_for_travel(*travel_m);
}

std::size_t segment_samples_for_travel(double travel_per_sample_m) {
  constexpr std::size_t kLargest = 1000;
  if (!(travel_per_sample_m * double{kLargest} > kSegmentTravel_m)) {
    return kLargest;
  }

  const auto suitable =
      static_cast<std::size_t>(std::lround(kSegmentTravel_m / travel_per_sample_m));
  return std::clamp<std::size_t>(suitable, 1, kLargest);
}

}  // namespace abbe::calib::otf
