#include "samples/unreachable_samples.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::calib::otf {
namespace {

constexpr double kLeastReach_m = 1e-3;
constexpr double kFaster = 3.0;          // factor of the usual travel per sample
constexpr double kMostVariation = 10.0;  // largest accepted variation of the travel per sample
                                         // within a run
constexpr std::size_t kNeighbours = 8;

double quantile_of(std::vector<double> values, double share) {
  if (values.empty()) {
    return 0.0;
  }
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Computes whether the target can have travelled from one valid sample of a run to another. A link
/// is a pair of successive valid samples.
class Reach {
 public:
  explicit Reach(std::span<const TrackerObservation> samples) : samples_(samples) {
    std::vector<double> steps_s;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (i > 0) {
        steps_s.push_back(samples[i].time_s - samples[i - 1].time_s);
      }
      if (samples[i].valid) {
        valid_.push_back(i);
      }
    }
    period_s_ = quantile_of(std::move(steps_s), 0.5);
  }

  [[nodiscard]] std::size_t size() const { return valid_.size(); }
  [[nodiscard]] std::size_t sample(std::size_t i) const { return valid_[i]; }
  [[nodiscard]] double distance_m(std::size_t i, std::size_t j) const {
    return (samples_[valid_[j]].p_tracker_m - samples_[valid_[i]].p_tracker_m).norm();
  }

  void set_usual_travel() {
    std::vector<double> travel_m;
    for (std::size_t i = 0; i + 1 < size(); ++i) {
      travel_m.push_back(travel_of_link_m(i));
    }
    usual_m_ = quantile_of(std::move(travel_m), 0.75);
  }

  /// Median travel per sample over the last links in [begin, end); first_m(): over the first links.
  [[nodiscard]] double last_m(std::size_t begin, std::size_t end) const {
    return median_m(std::max(begin, end - std::min(end, kNeighbours)), end);
  }
  [[nodiscard]] double first_m(std::size_t begin, std::size_t end) const {
    return median_m(begin, std::min(end, begin + kNeighbours));
  }

  /// True if the target can have travelled from valid sample i to j. `local_m`: travel per sample
  /// around them.
  [[nodiscard]] bool reaches(std::size_t i, std::size_t j, double local_m) const {
    // The limit prevents spikes that are close together from increasing each other's permitted
    // travel.
    const double travel_m =
        usual_m_ > 0.0 ? std::clamp(local_m, usual_m_, kMostVariation * usual_m_) : local_m;
    return distance_m(i, j) <= kLeastReach_m + kFaster * periods(i, j) * travel_m;
  }

 private:
  [[nodiscard]] double periods(std::size_t i, std::size_t j) const {
    const double by_time =
        period_s_ > 0.0
            ? std::round((samples_[valid_[j]].time_s - samples_[valid_[i]].time_s) / period_s_)
            : 1.0;
    return std::max(by_time, static_cast<double>(valid_[j] - valid_[i]));
  }
  [[nodiscard]] double travel_of_link_m(std::size_t i) const {
    return distance_m(i, i + 1) / periods(i, i + 1);
  }
  [[nodiscard]] double median_m(std::size_t begin, std::size_t end) const {
    std::vector<double> travel_m;
    for (std::size_t i = begin; i < end; ++i) {
      travel_m.push_back(travel_of_link_m(i));
    }
    return quantile_of(std::move(travel_m), 0.5);
  }

  std::span<const TrackerObservation> samples_;
  std::vector<std::size_t> valid_;
  double period_s_ = 0.0, usual_m_ = 0.0;
};

/// Range of valid samples [first, last] in which each sample is reachable from the previous one.
struct ReachablePart {
  std::size_t first = 0, last = 0;
  double first_m = 0.0, last_m = 0.0;  ///< travel per sample at both ends of the part
  std::size_t kept = 0;           ///< largest number of samples in a sequence of parts that ends
                                  ///< with this part
  std::size_t before = SIZE_MAX;  ///< previous part in that sequence
};

std::vector<ReachablePart> reachable_parts(Reach& reach) {
  bool has_usual_travel = false;
  std::vector<ReachablePart> parts{{}};
  for (std::size_t i = 0; i + 1 < reach.size(); ++i) {
    parts.back().last = i;
    if (reach.distance_m(i, i + 1) <= kLeastReach_m) {
      continue;
    }

    if (!has_usual_travel) {
      reach.set_usual_travel();
      has_usual_travel = true;
    }

    const double local_m = std::max(reach.last_m(0, i), reach.first_m(i + 1, reach.size() - 1));
    if (!reach.reaches(i, i + 1, local_m)) {
      parts.push_back({.first = i + 1, .last = i + 1});
    }
  }
  parts.back().last = reach.size() - 1;

  for (ReachablePart& part : parts) {
    part.first_m = reach.first_m(part.first, part.last);
    part.last_m = reach.last_m(part.first, part.last);
  }
  return parts;
}

/// Connects the parts to sequences. Returns the index of the last part of the sequence with most
/// samples.
std::size_t link_parts(std::vector<ReachablePart>& parts, const Reach& reach) {
  constexpr std::size_t kMostBetween = 64;  // number of parts; limits the time for a run with many
                                            // single spikes
  std::size_t best = 0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    ReachablePart& part = parts[k];
    std::size_t before = 0;
    for (std::size_t j = k - std::min(k, kMostBetween); j < k; ++j) {
      if (parts[j].kept > before &&
          reach.reaches(parts[j].last, part.first, std::max(parts[j].last_m, part.first_m))) {
        before = parts[j].kept;
        part.before = j;
      }
    }
    part.kept = before + part.last - part.first + 1;
    if (part.kept > parts[best].kept) {
      best = k;
    }
  }
  return best;
}

}  // namespace

std::vector<bool> unreachable_samples(std::span<const TrackerObservation> samples) {
  constexpr double kMostOutside = 0.2;
  Reach reach(samples);
  if (reach.size() < 2) {
    return {};
  }

  std::vector<ReachablePart> parts = reachable_parts(reach);
  if (parts.size() == 1) {
    return {};
  }

  const std::size_t best = link_parts(parts, reach);
  if (static_cast<double>(parts[best].kept) <
      (1.0 - kMostOutside) * static_cast<double>(reach.size())) {
    return {};
  }

  std::vector<bool> aside(samples.size(), true);
  for (std::size_t k = best; k != SIZE_MAX; k = parts[k].before) {
    for (std::size_t i = parts[k].first; i <= parts[k].last; ++i) {
      aside[reach.sample(i)] = false;
    }
  }
  for (std::size_t i = 0; i < samples.size(); ++i) {
    aside[i] = aside[i] && samples[i].valid;
  }
  const bool any = std::find(aside.begin(), aside.end(), true) != aside.end();
  return any ? aside : std::vector<bool>{};
}

}  // namespace abbe::calib::otf
