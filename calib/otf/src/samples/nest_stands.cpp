#include "samples/nest_stands.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace abbe::calib::otf {
namespace {

constexpr double kLongestPause_s = 2.0;

/// Groups of samples near one nest. A sample elsewhere or a long pause ends a group.
std::vector<NearNest> groups_near(std::span<const TrackerObservation> samples,
                                  const std::vector<Nest>& nests) {
  std::vector<NearNest> groups;
  bool open = false;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!samples[i].valid) {
      continue;
    }
    const auto nest = nest_at(samples[i].p_tracker_m, nests);
    if (!nest) {
      open = false;
      continue;
    }

    const bool goes_on =
        open && groups.back().nest == *nest &&
        samples[i].time_s - samples[groups.back().samples.back()].time_s <= kLongestPause_s;
    if (!goes_on) {
      groups.push_back({*nest, {}});
    }
    groups.back().samples.push_back(i);
    open = true;
  }
  return groups;
}

Vector3 median_position(std::span<const TrackerObservation> samples,
                        const std::vector<std::size_t>& of) {
  Vector3 median;
  std::vector<double> values(of.size());
  for (Eigen::Index k = 0; k < 3; ++k) {
    std::transform(of.begin(), of.end(), values.begin(),
                   [&](std::size_t i) { return samples[i].p_tracker_m(k); });
    const auto middle = values.begin() + std::ssize(values) / 2;
    std::nth_element(values.begin(), middle, values.end());
    median(k) = *middle;
  }
  return median;
}

/// The samples of a group at which the target stands still; empty if the target only moves past.
std::vector<std::size_t> standing_samples(std::span<const TrackerObservation> samples,
                                          const NearNest& group, const Noise& noise) {
  constexpr double kStand_m = 50e-6, kSigmas = 6.0;
  const Vector3 at = median_position(samples, group.samples);
  const double limit_m =
      std::max(kStand_m, kSigmas * std::sqrt(noise_of_sample(at, noise).trace()));
  std::vector<std::size_t> standing;
  std::copy_if(group.samples.begin(), group.samples.end(), std::back_inserter(standing),
               [&](std::size_t i) { return (samples[i].p_tracker_m - at).norm() <= limit_m; });
  return 2 * standing.size() >= group.samples.size() ? standing : std::vector<std::size_t>{};
}

double middle_value(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Distinguishes the machine's target, which moves or stands near a nest, from the target in the
/// nest: the beam needs time to move from one to the other.
class TargetOnMachine {
 public:
  explicit TargetOnMachine(std::span<const TrackerObservation> samples) : samples_(samples) {
    std::vector<double> steps_s, speeds_m_per_s;
    for (std::size_t i = 1; i < samples.size(); ++i) {
      const double step_s = samples[i].time_s - samples[i - 1].time_s;
      if (!(step_s > 0.0) || !std::isfinite(step_s)) {
        continue;
      }
      steps_s.push_back(step_s);
      const double speed_m_per_s = distance_m(i - 1, i) / step_s;
      if (samples[i].valid && samples[i - 1].valid && std::isfinite(speed_m_per_s)) {
        speeds_m_per_s.push_back(speed_m_per_s);
      }
    }
    if (!speeds_m_per_s.empty()) {
      period_s_ = middle_value(std::move(steps_s));
      const auto fast = speeds_m_per_s.begin() + 9 * std::ssize(speeds_m_per_s) / 10;
      std::nth_element(speeds_m_per_s.begin(), fast, speeds_m_per_s.end());
      usual_m_per_s_ = *fast;
    }
  }

  /// True if the target moves continuously into or out of the group: its first sample follows the
  /// valid sample before it, or the next valid sample follows its last sample (follows()).
  [[nodiscard]] bool goes_on_in(const std::vector<std::size_t>& group) const {
    const std::size_t last = group.size() - 1;
    std::size_t before = group.front(), after = group.back() + 1;
    while (before > 0 && !samples_[before - 1].valid) {
      --before;
    }
    while (after < samples_.size() && !samples_[after].valid) {
      ++after;
    }
    const double into_m_per_s = speed_m_per_s(group.front(), group[std::min<std::size_t>(1, last)]);
    const double from_m_per_s =
        speed_m_per_s(group[last - std::min<std::size_t>(1, last)], group.back());
    return (before > 0 && follows(before - 1, group.front(), into_m_per_s)) ||
           (after < samples_.size() && follows(group.back(), after, from_m_per_s));
  }

 private:
  [[nodiscard]] double distance_m(std::size_t i, std::size_t k) const {
    return (samples_[k].p_tracker_m - samples_[i].p_tracker_m).norm();
  }
  [[nodiscard]] double speed_m_per_s(std::size_t i, std::size_t k) const {
    const double step_s = samples_[k].time_s - samples_[i].time_s;
    return step_s > 0.0 ? distance_m(i, k) / step_s : 0.0;
  }
  /// True if sample k follows sample i without time for the beam to change the target.
  /// `near_m_per_s`: speed around these two samples.
  [[nodiscard]] bool follows(std::size_t i, std::size_t k, double near_m_per_s) const {
    constexpr double kMostPeriods = 4.5, kLeastReach_m = 1e-3, kFaster = 3.0;
    const double step_s = samples_[k].time_s - samples_[i].time_s;
    return step_s <= kMostPeriods * period_s_ &&
           distance_m(i, k) <=
               kLeastReach_m + kFaster * std::max(usual_m_per_s_, near_m_per_s) * step_s;
  }

  std::span<const TrackerObservation> samples_;
  double period_s_ = 0.0, usual_m_per_s_ = 0.0;
};

}  // namespace

Matrix3 noise_of_sample(const Vector3& p_m, const Noise& noise) {
  const double range_m = p_m.norm();
  const Vector3 beam = p_m / range_m;
  const Matrix3 along = beam * beam.transpose();
  const double across_m = noise.sigma_angle_rad * range_m;
  return noise.sigma_range_m * noise.sigma_range_m * along +
         across_m * across_m * (Matrix3::Identity() - along);
}

Vector3 mean_position(std::span<const TrackerObservation> samples,
                      std::span<const std::size_t> of) {
  const Vector3& first = samples[of.front()].p_tracker_m;
  Vector3 sum = Vector3::Zero();
  for (const std::size_t i : of) {
    sum += samples[i].p_tracker_m - first;
  }
  return first + sum / static_cast<double>(of.size());
}

std::vector<Stand> stands_near(std::span<const TrackerObservation> samples,
                               const std::vector<Nest>& nests, const Noise& noise) {
  const TargetOnMachine machine(samples);
  std::vector<Stand> stands;
  for (NearNest& group : groups_near(samples, nests)) {
    Stand stand{.group = std::move(group)};
    stand.samples = standing_samples(samples, stand.group, noise);
    if (!stand.samples.empty()) {
      stand.mean_m = mean_position(samples, stand.samples);
      stand.goes_on = machine.goes_on_in(stand.group.samples);
      stands.push_back(std::move(stand));
    }
  }
  return stands;
}

bool is_of_machine(const Stand& stand, const std::vector<Stand>& all) {
  constexpr double kSamePlace_m = 1e-3;
  return std::any_of(all.begin(), all.end(), [&](const Stand& other) {
    return other.goes_on && (other.mean_m - stand.mean_m).norm() <= kSamePlace_m;
  });
}

std::optional<std::size_t> nest_at(const Vector3& p_tracker_m, const std::vector<Nest>& nests) {
  for (std::size_t n = 0; n < nests.size(); ++n) {
    if ((p_tracker_m - nests[n].position_tracker_m).norm() <= nests[n].radius_m) {
      return n;
    }
  }
  return std::nullopt;
}

}  // namespace abbe::calib::otf
