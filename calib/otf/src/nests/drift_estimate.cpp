#include "nests/drift_estimate.hpp"

#include <cmath>

#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"
#include "nests/nest_places.hpp"

namespace abbe::calib::otf {
namespace {

/// Mean of the estimates over all grid cells (course, amplitude, repeatability), weighted with
/// their likelihood.
DriftEstimate mean_estimate(const DriftLikelihood& likelihood, const LikelihoodGrid& grid) {
  constexpr double kLeastWeight = 1e-6;
  const double most = grid.best().log_likelihood;
  const Eigen::Index n = grid.equations.front().b.size();
  DriftEstimate e{.d = Eigen::VectorXd::Zero(n), .covariance = Eigen::MatrixXd::Zero(n, n)};
  double weights = 0.0, u_m2 = 0.0, walk_m2 = 0.0;

  for (const DriftCell& cell : grid.cells) {
    const double weight = exponential(cell.log_likelihood - most);
    if (weight > kLeastWeight) {
      const Eigen::VectorXd d = likelihood.unknowns(grid, cell);
      weights += weight;
      u_m2 += weight * grid.u_m(cell) * grid.u_m(cell);
      walk_m2 += weight * grid.walk_m(cell) * grid.walk_m(cell);
      e.d += weight * d;
      e.covariance += weight * (likelihood.covariance(grid, cell) + d * d.transpose());
    }
  }

  e.d /= weights;
  e.covariance = e.covariance / weights - e.d * e.d.transpose();
  e.u_repeatability_m = std::sqrt(u_m2 / weights);
  e.walk_m = std::sqrt(walk_m2 / weights);
  return e;
}

}  // namespace

Result<DriftEstimate> estimate_drift(const DriftObservations& d, const DriftEquations& equations,
                                     const Stopped& stopped) {
  const DriftLikelihood likelihood(d, equations);
  const Result<PlacesFound> found = find_places(likelihood, stopped);
  ABBE_TRY(found);

  DriftEstimate e = mean_estimate(likelihood, found->grid);
  e.visits = visits_used(found->place);
  e.notes = notes_on_places(d, found->place,
                            likelihood.nests().positions(found->place, e.u_repeatability_m,
                                                         likelihood.coefficients(e.d)));
  return e;
}

}  // namespace abbe::calib::otf
