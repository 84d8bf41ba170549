#include "otf/drift_estimate.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "elementary.hpp"
#include "message.hpp"

namespace abbe::calib::otf {
namespace {

constexpr std::array kRepeatabilityFactors{1.0, 2.0, 4.0, 8.0};
constexpr double kLeastAmplitude_m = 0.1e-6;
constexpr int kAmplitudes = 14;  // doubled from one to the next: up to 0.8 mm

using Places = std::vector<std::size_t>;

/// The equations for one repeatability, with the prior as unit matrix for the amplitude 1.
struct ScaledEquations {
  Eigen::MatrixXd P;
  Eigen::VectorXd b;
  double constant = 0.0;
  double u_m = 0.0;
};

/// One pair of amplitude and repeatability.
struct DriftCell {
  Eigen::VectorXd scale;              ///< D: amplitude, or 1 for the range offset
  Eigen::LLT<Eigen::MatrixXd> llt{};  ///< of I + D P D
  Eigen::VectorXd y{};                ///< D (I + D P D)^-1 D b
  double log_likelihood = 0.0;
  double u_m = 0.0;
};

class DriftLikelihood {
 public:
  DriftLikelihood(const DriftObservations& d, const DriftEquations& equations)
      : d_(d), equations_(equations), basis_(d), nests_(d, basis_) {
    const Eigen::Index k = equations.offsets(), n = equations.g.size();
    root_ = Eigen::MatrixXd::Zero(n, n);
    root_.diagonal().head(k).setConstant(equations.u_range_offset_m);
    root_.bottomRightCorner(n - k, n - k) = basis_.root_of_prior();
  }

  [[nodiscard]] std::vector<DriftCell> cells(const Places& place) const {
    std::vector<DriftCell> all;
    for (const double factor : kRepeatabilityFactors) {
      const ScaledEquations e = scaled(place, factor * d_.u_repeatability_m);
      double amplitude_m = kLeastAmplitude_m;
      for (int i = 0; i < kAmplitudes; ++i, amplitude_m *= 2.0) {
        all.push_back(cell(e, amplitude_m));
      }
    }
    return all;
  }

  [[nodiscard]] double log_likelihood(const Places& place) const {
    return best_of(cells(place)).log_likelihood;
  }
  [[nodiscard]] static const DriftCell& best_of(const std::vector<DriftCell>& cells) {
    return *std::max_element(
        cells.begin(), cells.end(),
        [](const DriftCell& a, const DriftCell& b) { return a.log_likelihood < b.log_likelihood; });
  }

  [[nodiscard]] Eigen::VectorXd unknowns(const DriftCell& cell) const { return root_ * cell.y; }
  [[nodiscard]] Eigen::MatrixXd covariance(const DriftCell& cell) const {
    const Eigen::MatrixXd half =
        cell.llt.matrixL().solve(Eigen::MatrixXd(cell.scale.asDiagonal() * root_.transpose()));
    return half.transpose() * half;
  }
  [[nodiscard]] Eigen::VectorXd coefficients(const Eigen::VectorXd& unknowns) const {
    return unknowns.tail(unknowns.size() - equations_.offsets());
  }
  [[nodiscard]] const NestRows& nests() const { return nests_; }
  [[nodiscard]] const DriftObservations& observations() const { return d_; }

 private:
  [[nodiscard]] ScaledEquations scaled(const Places& place, double u_m) const {
    const NestInformation nests = nests_.information(place, u_m);
    const Eigen::Index m = nests.Nc.size();
    Eigen::MatrixXd information = equations_.S;
    information.bottomRightCorner(m, m) += nests.N;
    Eigen::VectorXd g = equations_.g;
    g.tail(m) += nests.Nc;
    const Eigen::MatrixXd P = root_.transpose() * information * root_;
    return {0.5 * (P + P.transpose()), root_.transpose() * g, nests.constant, u_m};
  }

  [[nodiscard]] DriftCell cell(const ScaledEquations& e, double amplitude_m) const {
    const Eigen::Index n = e.b.size();
    DriftCell cell{.scale = Eigen::VectorXd::Constant(n, amplitude_m), .u_m = e.u_m};
    cell.scale.head(equations_.offsets()).setOnes();
    Eigen::MatrixXd M = cell.scale.asDiagonal() * e.P * cell.scale.asDiagonal();
    M.diagonal().array() += 1.0;
    cell.llt.compute(M);

    const Eigen::VectorXd b = cell.scale.asDiagonal() * e.b;
    const Eigen::VectorXd x = cell.llt.solve(b);
    cell.y = cell.scale.asDiagonal() * x;
    double log_determinant = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      log_determinant += 2.0 * natural_logarithm(cell.llt.matrixLLT()(i, i));
    }
    cell.log_likelihood = cell.llt.info() == Eigen::Success
                              ? -0.5 * (e.constant + log_determinant - b.dot(x))
                              : -std::numeric_limits<double>::infinity();
    return cell;
  }

  const DriftObservations& d_;
  const DriftEquations& equations_;
  DriftBasis basis_;
  NestRows nests_;
  Eigen::MatrixXd root_;
};

/// One place for each nest.
Places places_of_nests(const DriftObservations& d) {
  Places place;
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

/// The visits of a place, as indices.
std::vector<std::size_t> visits_of(const Places& place, std::size_t at) {
  std::vector<std::size_t> visits;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (place[v] == at) {
      visits.push_back(v);
    }
  }
  return visits;
}

/// Number of visits before the change of position that explains most of their squares.
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

/// The places if the nest of visit `worst` moved, and if this visit is wrong.
std::vector<Places> other_places(const Places& place, std::size_t worst,
                                 const std::vector<Vector3>& measured_m) {
  const std::vector<std::size_t> visits = visits_of(place, place[worst]);
  if (visits.size() < 2) {
    return {};
  }

  const std::size_t next = *std::max_element(place.begin(), place.end()) + 1;
  Places alone = place, after = place;
  alone[worst] = next;
  for (std::size_t i = likely_change(visits, measured_m); i < visits.size(); ++i) {
    after[visits[i]] = next;
  }
  return {std::move(alone), std::move(after)};
}

/// The places of the visits: more than one for a nest that moved.
Places find_places(const DriftLikelihood& likelihood) {
  constexpr double kSuspicious = 4.0, kLeastGain = 8.0;
  const DriftObservations& d = likelihood.observations();
  Places place = places_of_nests(d);
  for (std::size_t round = 0; round < d.visits.size(); ++round) {
    const std::vector<DriftCell> cells = likelihood.cells(place);
    const DriftCell& best = DriftLikelihood::best_of(cells);
    const Eigen::VectorXd c = likelihood.coefficients(likelihood.unknowns(best));
    const std::vector<double> sizes = likelihood.nests().residuals(place, d.u_repeatability_m, c);
    const auto worst = std::max_element(sizes.begin(), sizes.end());
    if (!(*worst > kSuspicious)) {
      break;
    }

    double most = best.log_likelihood + kLeastGain;
    Places better;
    for (Places& other : other_places(place, static_cast<std::size_t>(worst - sizes.begin()),
                                      likelihood.nests().measured_m(c))) {
      if (const double l = likelihood.log_likelihood(other); l > most) {
        most = l;
        better = std::move(other);
      }
    }
    if (better.empty()) {
      break;
    }
    place = std::move(better);
  }
  return place;
}

std::size_t visits_at(const Places& place, std::size_t at) {
  return visits_of(place, at).size();
}

/// Notes for nests with more than one place.
std::vector<std::string> notes_on_places(const DriftObservations& d, const Places& place,
                                         const std::vector<Vector3>& at_m) {
  std::vector<std::string> notes;
  for (std::size_t v = 0; v < place.size(); ++v) {
    std::size_t before = v;
    while (before > 0 && d.visits[before - 1].nest != d.visits[v].nest) {
      --before;
    }
    if (before == 0 || place[before - 1] == place[v]) {
      continue;
    }
    const double moved_um = 1e6 * (at_m[place[v]] - at_m[place[before - 1]]).norm();
    const bool alone = visits_at(place, place[v]) == 1;
    notes.push_back(message(
        "reference nest ", d.names[d.visits[v].nest], " was found ", moved_um,
        " um away from its previous position at its visit after ",
        d.visits[v].time_s - d.knots_s.front(), " s, while the other nests and the run were not: ",
        alone ? "this visit is not used" : "it was moved; its visits count as two positions"));
  }
  return notes;
}

/// Mean over the pairs of amplitude and repeatability, weighted with their likelihood.
DriftEstimate mean_estimate(const DriftLikelihood& likelihood,
                            const std::vector<DriftCell>& cells) {
  constexpr double kLeastWeight = 1e-6;
  const double most = DriftLikelihood::best_of(cells).log_likelihood;
  const Eigen::Index n = cells.front().y.size();
  DriftEstimate e{.d = Eigen::VectorXd::Zero(n), .covariance = Eigen::MatrixXd::Zero(n, n)};
  double weights = 0.0, u_m2 = 0.0;

  for (const DriftCell& cell : cells) {
    const double weight = exponential(cell.log_likelihood - most);
    if (weight > kLeastWeight) {
      const Eigen::VectorXd d = likelihood.unknowns(cell);
      weights += weight;
      u_m2 += weight * cell.u_m * cell.u_m;
      e.d += weight * d;
      e.covariance += weight * (likelihood.covariance(cell) + d * d.transpose());
    }
  }

  e.d /= weights;
  e.covariance = e.covariance / weights - e.d * e.d.transpose();
  e.u_repeatability_m = std::sqrt(u_m2 / weights);
  return e;
}

}  // namespace

DriftEstimate estimate_drift(const DriftObservations& d, const DriftEquations& equations) {
  const DriftLikelihood likelihood(d, equations);
  const Places place = find_places(likelihood);
  DriftEstimate e = mean_estimate(likelihood, likelihood.cells(place));
  e.visits = static_cast<std::size_t>(std::count_if(
      place.begin(), place.end(), [&](std::size_t at) { return visits_at(place, at) > 1; }));
  e.notes = notes_on_places(
      d, place,
      likelihood.nests().positions(place, e.u_repeatability_m, likelihood.coefficients(e.d)));
  return e;
}

}  // namespace abbe::calib::otf
