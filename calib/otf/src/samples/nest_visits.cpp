#include "abbe/calib/otf/samples/nest_visits.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "samples/nest_stands.hpp"

namespace abbe::calib::otf {
namespace {

constexpr double kLeastVisit_s = 0.5;

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

/// Variances of means over `count` consecutive samples, summed over the three coordinates.
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

std::string machine_text(const Nest& nest, std::size_t times) {
  return message("reference nest ", nest.name, ": the target of the machine stood within ",
                 1e3 * nest.radius_m, " mm of ", mm_text(nest.position_tracker_m), " ", times,
                 times == 1 ? " time" : " times",
                 ", which is not a visit; check position_mm, or use a smaller radius");
}

std::string never_text(const Nest& nest) {
  return message("reference nest ", nest.name, " was never measured: no target stood within ",
                 1e3 * nest.radius_m, " mm of ", mm_text(nest.position_tracker_m),
                 " in the tracker frame; check position_mm");
}

void add_notes(NestVisits& visits, const std::vector<Nest>& nests,
               const std::vector<std::size_t>& too_short,
               const std::vector<std::size_t>& of_machine) {
  for (std::size_t n = 0; n < nests.size(); ++n) {
    const bool seen = std::any_of(visits.found.begin(), visits.found.end(),
                                  [&](const NestVisit& v) { return v.nest == n; });
    if (of_machine[n] > 0) {
      visits.notes.push_back(machine_text(nests[n], of_machine[n]));
    }
    if (too_short[n] > 0) {
      visits.notes.push_back(too_short_text(nests[n], too_short[n]));
    } else if (!seen && of_machine[n] == 0) {
      visits.notes.push_back(never_text(nests[n]));
    }
  }
}

}  // namespace

Result<NestVisits> find_nest_visits(std::span<const TrackerObservation> samples,
                                    const NestOptions& options, const Noise& noise) {
  NestVisits visits;
  if (options.nests.empty()) {
    return visits;
  }
  ABBE_TRY(check_nests(options));

  std::vector<std::size_t> too_short(options.nests.size(), 0), of_machine = too_short;
  for (const Nest& nest : options.nests) {
    visits.names.push_back(nest.name);
  }

  const std::vector<Stand> stands = stands_near(samples, options.nests, noise);
  for (const Stand& stand : stands) {
    if (is_of_machine(stand, stands)) {
      ++of_machine[stand.group.nest];
      continue;
    }
    visits.samples.insert(visits.samples.end(), stand.group.samples.begin(),
                          stand.group.samples.end());
    if (is_long_enough(samples, stand.samples)) {
      visits.found.push_back(visit_of(samples, stand.group, stand.samples, noise));
    } else {
      ++too_short[stand.group.nest];
    }
  }

  add_notes(visits, options.nests, too_short, of_machine);
  return visits;
}

}  // namespace abbe::calib::otf
