#include "nests/nest_places.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

/// The assignment in which each nest has one place.
NestPlaces places_of_nests(const DriftObservations& d) {
  NestPlaces place;
  std::vector<std::size_t> nests;
  for (const NestVisit& visit : d.visits) {
    const auto known = std::find(nests.begin(), nests.end(), visit.nest);
    place.push_back(static_cast<std::size_t>(known - nests.begin()));
    if (known == nests.end()) {
      nests.push_back(visit.nest);
    }
  }
  return place;
}

/// Indices of the visits of a place.
std::vector<std::size_t> visits_of(const NestPlaces& place, std::size_t at) {
  std::vector<std::size_t> visits;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (place[v] == at) {
      visits.push_back(v);
    }
  }
  return visits;
}

bool is_used(const NestPlaces& place, std::size_t visit) {
  return std::count(place.begin(), place.end(), place[visit]) > 1;
}

/// Number of visits before the most probable change of position: the change that explains most of
/// the squared deviations.
std::size_t likely_change(const std::vector<std::size_t>& visits,
                          const std::vector<Vector3>& measured_m) {
  Vector3 sum = Vector3::Zero(), before = Vector3::Zero();
  for (const std::size_t v : visits) {
    sum += measured_m[v];
  }

  const auto n = static_cast<double>(visits.size());
  std::size_t best = 1;
  double most = 0.0;
  for (std::size_t i = 1; i < visits.size(); ++i) {
    before += measured_m[visits[i - 1]];
    const auto m = static_cast<double>(i);
    const double squares = m * (n - m) / n * (before / m - (sum - before) / (n - m)).squaredNorm();
    if (squares > most) {
      most = squares;
      best = i;
    }
  }
  return best;
}

/// Two alternative assignments: the nest moved at visit `worst`, or only this visit is wrong.
std::vector<NestPlaces> other_places(const NestPlaces& place, std::size_t worst,
                                     const std::vector<Vector3>& measured_m) {
  const std::vector<std::size_t> visits = visits_of(place, place[worst]);
  if (visits.size() < 2) {
    return {};
  }

  const std::size_t next = *std::max_element(place.begin(), place.end()) + 1;
  NestPlaces alone = place, after = place;
  alone[worst] = next;
  for (std::size_t i = likely_change(visits, measured_m); i < visits.size(); ++i) {
    after[visits[i]] = next;
  }
  return {std::move(alone), std::move(after)};
}

/// For each place with a suspicious residual: its worst visit.
std::vector<std::size_t> suspicious_visits(const NestPlaces& place,
                                           const std::vector<double>& residuals) {
  constexpr double kSuspiciousVisit = 4.0;
  std::vector<std::size_t> worst;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (!(residuals[v] > kSuspiciousVisit)) {
      continue;
    }
    const auto same = std::find_if(worst.begin(), worst.end(),
                                   [&](std::size_t w) { return place[w] == place[v]; });
    if (same == worst.end()) {
      worst.push_back(v);
    } else if (residuals[v] > residuals[*same]) {
      *same = v;
    }
  }
  return worst;
}

/// Assignment with one more place that explains the visits clearly better; nullopt if there is
/// none.
Result<std::optional<PlacesFound>> better_places(const DriftLikelihood& likelihood,
                                                 const PlacesFound& found, const Stopped& stopped) {
  constexpr double kLeastGain = 8.0;
  const DriftObservations& d = likelihood.observations();
  const Eigen::VectorXd c =
      likelihood.coefficients(likelihood.unknowns(found.grid, found.grid.best()));
  const std::vector<double> sizes =
      likelihood.nests().residuals(found.place, d.u_repeatability_m, c);
  const std::vector<Vector3> measured_m = likelihood.nests().measured_m(c);

  double most = found.grid.best().log_likelihood + kLeastGain;
  std::optional<PlacesFound> better;
  for (const std::size_t worst : suspicious_visits(found.place, sizes)) {
    for (NestPlaces& other : other_places(found.place, worst, measured_m)) {
      Result<LikelihoodGrid> grid = likelihood.grid(other, stopped);
      ABBE_TRY(grid);
      if (grid->best().log_likelihood > most) {
        most = grid->best().log_likelihood;
        better = PlacesFound{std::move(other), *std::move(grid)};
      }
    }
  }
  return better;
}

/// Another visit of the same nest with which the position is compared: the last used visit before
/// this one, else the first used visit after it, else the visit before it.
std::optional<std::size_t> visit_to_compare(const DriftObservations& d, const NestPlaces& place,
                                            std::size_t visit) {
  std::optional<std::size_t> before;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (v == visit || d.visits[v].nest != d.visits[visit].nest) {
      continue;
    }
    if (v < visit && (is_used(place, v) || !before || !is_used(place, *before))) {
      before = v;
    }
    if (v > visit && is_used(place, v)) {
      return before && is_used(place, *before) ? before : v;
    }
  }
  return before;
}

}  // namespace

Result<PlacesFound> find_places(const DriftLikelihood& likelihood, const Stopped& stopped) {
  NestPlaces place = places_of_nests(likelihood.observations());
  Result<LikelihoodGrid> grid = likelihood.grid(place, stopped);
  ABBE_TRY(grid);

  PlacesFound found{std::move(place), *std::move(grid)};
  for (std::size_t round = 0; round < found.place.size(); ++round) {
    Result<std::optional<PlacesFound>> better = better_places(likelihood, found, stopped);
    ABBE_TRY(better);
    if (!*better) {
      break;
    }
    found = **std::move(better);
  }
  return found;
}

std::size_t visits_used(const NestPlaces& place) {
  std::size_t used = 0;
  for (std::size_t v = 0; v < place.size(); ++v) {
    used += is_used(place, v) ? 1 : 0;
  }
  return used;
}

std::vector<std::string> notes_on_places(const DriftObservations& d, const NestPlaces& place,
                                         const std::vector<Vector3>& at_m) {
  std::vector<std::string> notes;
  for (std::size_t v = 0; v < place.size(); ++v) {
    const std::optional<std::size_t> other = visit_to_compare(d, place, v);
    const bool used = is_used(place, v);
    if (!other || place[*other] == place[v] || (used && *other > v)) {
      continue;
    }
    const double moved_um = 1e6 * (at_m[place[v]] - at_m[place[*other]]).norm();
    notes.push_back(message(
        "reference nest ", d.names[d.visits[v].nest], " was found ", moved_um, " um away from its ",
        *other < v ? "previous" : "next", " position at its visit after ",
        d.visits[v].time_s - d.knots_s.front(), " s, while the other nests and the run were not: ",
        used ? "it was moved; its visits count as two positions" : "this visit is not used"));
  }
  return notes;
}

}  // namespace abbe::calib::otf
