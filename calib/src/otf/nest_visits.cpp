#include "abbe/calib/otf/nest_visits.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "message.hpp"

namespace abbe::calib::otf {
namespace {

constexpr double kLongestPause_s = 2.0, kLeastVisit_s = 0.5;

/// Valid samples within the radius of a nest: indices in the stream.
struct NearNest {
  std::size_t nest = 0;
  std::vector<std::size_t> samples;
};

Result<void> check_nest(const Nest& nest) {
  if (nest.name.empty()) {
    return failure(ErrorCode::BadInput, "reference nests: a nest has no name");
  }
  if (!nest.position_tracker_m.allFinite()) {
    return failure(ErrorCode::NotFinite,
                   message("reference nest ", nest.name, ": the position is not a number"));
  }
  if (!(nest.radius_m > 0.0) || !std::isfinite(nest.radius_m)) {
    return failure(ErrorCode::BadInput, message("reference nest ", nest.name, ": radius ",
                                                1e3 * nest.radius_m, " mm: must be positive"));
  }
  return {};
}

Result<void> check_pair(const Nest& one, const Nest& other) {
  if (one.name == other.name) {
    return failure(ErrorCode::BadInput,
                   message("reference nests: two nests have the name ", one.name));
  }
  const double apart_m = (one.position_tracker_m - other.position_tracker_m).norm();
  if (apart_m <= one.radius_m + other.radius_m) {
    return failure(ErrorCode::BadInput,
                   message("reference nests ", one.name, " and ", other.name, " are ",
                           1e3 * apart_m, " mm apart, less than the sum of their radii, ",
                           1e3 * (one.radius_m + other.radius_m), " mm: use smaller radii"));
  }
  return {};
}

Result<void> check_nests(const NestOptions& options) {
  if (!(options.u_repeatability_m > 0.0) || !std::isfinite(options.u_repeatability_m)) {
    return failure(ErrorCode::BadInput,
                   message("reference nests: repeatability ", 1e6 * options.u_repeatability_m,
                           " um: must be positive"));
  }

  for (std::size_t i = 0; i < options.nests.size(); ++i) {
    Result<void> valid = check_nest(options.nests[i]);
    for (std::size_t k = 0; valid && k < i; ++k) {
      valid = check_pair(options.nests[k], options.nests[i]);
    }
    if (!valid) {
      return valid;
    }
  }
  return {};
}

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

/// Sum of the variances of the coordinates of means over `count` consecutive samples.
double variance_of_means(std::span<const TrackerObservation> samples,
                         std::span<const std::size_t> of, std::size_t count) {
  const Vector3 mean = mean_position(samples, of);
  const std::size_t parts = of.size() / count;
  double squares = 0.0;
  for (std::size_t k = 0; k < parts; ++k) {
    squares += (mean_position(samples, of.subspan(k * count, count)) - mean).squaredNorm();
  }
  return squares / static_cast<double>(std::max<std::size_t>(1, parts - 1));
}

NestVisit visit_of(std::span<const TrackerObservation> samples, const NearNest& group,
                   const std::vector<std::size_t>& standing, const Noise& noise) {
  constexpr std::size_t kParts = 8;
  NestVisit visit{.nest = group.nest,
                  .time_s = 0.0,
                  .mean_tracker_m = mean_position(samples, standing),
                  .samples = standing.size()};
  const double first_s = samples[standing.front()].time_s;
  for (const std::size_t i : standing) {
    visit.time_s += (samples[i].time_s - first_s) / static_cast<double>(standing.size());
  }
  visit.time_s += first_s;

  const Matrix3 of_sample = noise_of_sample(visit.mean_tracker_m, noise);
  const std::size_t count = std::max<std::size_t>(1, standing.size() / kParts);
  const double stated_m2 = of_sample.trace();
  const double factor = std::max(
      {1.0, variance_of_means(samples, standing, 1) / stated_m2,
       static_cast<double>(count) * variance_of_means(samples, standing, count) / stated_m2});
  visit.cov_tracker_m2 = factor / static_cast<double>(standing.size()) * of_sample;
  return visit;
}

/// The samples of a group at which the target stands; empty if it passes.
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

bool is_long_enough(std::span<const TrackerObservation> samples,
                    const std::vector<std::size_t>& standing) {
  constexpr std::size_t kFewest = 4;
  return standing.size() >= kFewest &&
         samples[standing.back()].time_s - samples[standing.front()].time_s >= kLeastVisit_s;
}

std::string too_short_text(const Nest& nest, std::size_t times) {
  return message("reference nest ", nest.name, ": ", times, times == 1 ? " visit" : " visits",
                 " shorter than ", kLeastVisit_s, " s or with fewer than 4 samples not used");
}

std::string never_text(const Nest& nest) {
  return message("reference nest ", nest.name, " was never measured: no target stood within ",
                 1e3 * nest.radius_m, " mm of ", mm_text(nest.position_tracker_m),
                 " in the tracker frame; check position_mm");
}

void add_notes(NestVisits& visits, const std::vector<Nest>& nests,
               const std::vector<std::size_t>& too_short) {
  for (std::size_t n = 0; n < nests.size(); ++n) {
    const bool seen = std::any_of(visits.found.begin(), visits.found.end(),
                                  [&](const NestVisit& v) { return v.nest == n; });
    if (too_short[n] > 0) {
      visits.notes.push_back(too_short_text(nests[n], too_short[n]));
    } else if (!seen) {
      visits.notes.push_back(never_text(nests[n]));
    }
  }
}

}  // namespace

std::optional<std::size_t> nest_at(const Vector3& p_tracker_m, const std::vector<Nest>& nests) {
  for (std::size_t n = 0; n < nests.size(); ++n) {
    if ((p_tracker_m - nests[n].position_tracker_m).norm() <= nests[n].radius_m) {
      return n;
    }
  }
  return std::nullopt;
}

Result<NestVisits> find_nest_visits(std::span<const TrackerObservation> samples,
                                    const NestOptions& options, const Noise& noise) {
  NestVisits visits;
  if (options.nests.empty()) {
    return visits;
  }
  if (Result<void> valid = check_nests(options); !valid) {
    return tl::unexpected(valid.error());
  }

  std::vector<std::size_t> too_short(options.nests.size(), 0);
  for (const Nest& nest : options.nests) {
    visits.names.push_back(nest.name);
  }

  for (const NearNest& group : groups_near(samples, options.nests)) {
    const std::vector<std::size_t> standing = standing_samples(samples, group, noise);
    if (standing.empty()) {
      continue;
    }
    visits.samples.insert(visits.samples.end(), group.samples.begin(), group.samples.end());
    if (is_long_enough(samples, standing)) {
      visits.found.push_back(visit_of(samples, group, standing, noise));
    } else {
      ++too_short[group.nest];
    }
  }

  add_notes(visits, options.nests, too_short);
  return visits;
}

}  // namespace abbe::calib::otf
