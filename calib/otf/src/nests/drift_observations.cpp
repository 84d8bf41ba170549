#include "nests/drift_observations.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/otf/run/polyline.hpp"

namespace abbe::calib::otf {
namespace {

std::vector<std::size_t> visits_by_nest(const NestVisits& nests) {
  std::vector<std::size_t> count(nests.names.size(), 0);
  for (const NestVisit& visit : nests.found) {
    ++count[visit.nest];
  }
  return count;
}

/// Position of a nest: mean of its first visit.
Vector3 position_of(const NestVisits& nests, std::size_t nest) {
  return std::find_if(nests.found.begin(), nests.found.end(),
                      [&](const NestVisit& v) { return v.nest == nest; })
      ->mean_tracker_m;
}

/// Distance from a point in the tracker frame to the path. `leg` receives the index of the closest
/// leg.
double distance_to_legs_m(const Observations& o, const Vector3& p_tracker_m, std::size_t& leg) {
  const Vector3 q = o.alignment.T_machine_tracker * p_tracker_m - o.target_offset_m;
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < o.vertices_m.size(); ++i) {
    const Vector3 c = closest_on_leg(o.vertices_m[i], o.vertices_m[i + 1], q).closest_m;
    if ((q - c).norm() < least_m) {
      least_m = (q - c).norm();
      leg = i;
    }
  }
  return least_m;
}

/// The visits without those on the path, which are not visits: a nest cannot be where the machine's
/// target passes, so that the machine stood there. Adds a note for each nest concerned.
std::vector<NestVisit> visits_apart(const Observations& o, const NestVisits& nests,
                                    std::vector<std::string>& notes) {
  constexpr double kOnPath_m = 3e-3;  // as Options::max_alignment_distance_m
  std::vector<NestVisit> apart;
  std::vector<std::size_t> on_path(nests.names.size(), 0), leg(nests.names.size(), 0);
  for (const NestVisit& visit : nests.found) {
    if (distance_to_legs_m(o, visit.mean_tracker_m, leg[visit.nest]) <= kOnPath_m) {
      ++on_path[visit.nest];
    } else {
      apart.push_back(visit);
    }
  }

  for (std::size_t n = 0; n < on_path.size(); ++n) {
    if (on_path[n] > 0) {
      notes.push_back(message("reference nest ", nests.names[n], " is on leg ", leg[n],
                              " of the path: ", on_path[n],
                              on_path[n] == 1 ? " visit is" : " visits are",
                              " the machine itself and not used; check position_mm"));
    }
  }
  return apart;
}

/// True if three nests with at least two visits each are not on a line.
bool determine_rotation(const NestVisits& nests, const std::vector<std::size_t>& visits) {
  constexpr double kLeastHeight = 0.1;
  std::vector<Vector3> at;
  for (std::size_t n = 0; n < visits.size(); ++n) {
    if (visits[n] > 1) {
      at.push_back(position_of(nests, n));
    }
  }

  for (std::size_t a = 0; a < at.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      for (std::size_t c = 0; c < b; ++c) {
        const Vector3 u = at[b] - at[a], v = at[c] - at[a];
        const double longest2 = std::max({u.squaredNorm(), v.squaredNorm(), (u - v).squaredNorm()});
        if (u.cross(v).norm() > kLeastHeight * longest2) {
          return true;
        }
      }
    }
  }
  return false;
}

/// Sets the knots: evenly spaced times from `begin_s` to `end_s`, and the time of the first visit
/// between them.
void set_knots(DriftObservations& d, double begin_s, double end_s, std::size_t count) {
  const double zero_s = d.visits.front().time_s, duration_s = end_s - begin_s;
  const auto between = [&](double from_s, double to_s) {
    const double share = (to_s - from_s) / duration_s;
    const auto steps = std::max(1L, std::lround(share * static_cast<double>(count)));
    for (long i = 0; i < steps; ++i) {
      d.knots_s.push_back(from_s +
                          (to_s - from_s) * static_cast<double>(i) / static_cast<double>(steps));
    }
  };

  constexpr double kNegligible = 1e-3;
  if (zero_s - begin_s > kNegligible * duration_s) {
    between(begin_s, zero_s);
  }
  d.zero = d.knots_s.size();
  between(zero_s, end_s);
  d.knots_s.push_back(end_s);
}

DriftObservations drift_of(const RunTimes& times, const NestVisits& nests,
                           const std::vector<std::size_t>& visits, const NestOptions& options) {
  constexpr std::size_t kFewestKnots = 32, kMostKnots = 64;
  DriftObservations d{.segment_s = times.of_segment_s,
                      .visits = nests.found,
                      .names = nests.names,
                      .u_repeatability_m = options.u_repeatability_m,
                      .rotates = determine_rotation(nests, visits),
                      .length_m = 0.0};
  for (const NestVisit& visit : nests.found) {
    d.length_m += visit.mean_tracker_m.norm() / static_cast<double>(nests.found.size());
  }

  const std::size_t most = *std::max_element(visits.begin(), visits.end());
  const double end_s = std::max(times.end_s, nests.found.back().time_s);
  set_knots(d, times.begin_s, end_s, std::clamp(2 * most, kFewestKnots, kMostKnots));
  return d;
}

}  // namespace

Observations with_nest_visits(Observations o, const NestVisits& all, const RunTimes& times,
                              const NestOptions& options) {
  o.notes.insert(o.notes.end(), all.notes.begin(), all.notes.end());
  const NestVisits nests{.found = visits_apart(o, all, o.notes), .names = all.names};
  if (nests.found.empty()) {
    return o;
  }

  const std::vector<std::size_t> visits = visits_by_nest(nests);
  if (*std::max_element(visits.begin(), visits.end()) < 2) {
    o.notes.emplace_back(
        "no reference nest was visited twice: the drift of the tracker is not estimated");
    return o;
  }

  for (std::size_t n = 0; n < visits.size(); ++n) {
    if (visits[n] == 1) {
      o.notes.push_back(
          message("reference nest ", nests.names[n], " was visited once only: it shows no drift"));
    }
  }
  o.drift = drift_of(times, nests, visits, options);
  return o;
}

}  // namespace abbe::calib::otf
