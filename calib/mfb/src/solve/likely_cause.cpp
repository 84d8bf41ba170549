#include "solve/likely_cause.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "observe/without_pass.hpp"

namespace abbe::calib::mfb {
namespace {

/// Prior of the drift in the search for a cause: larger than the drift of any machine during one
/// pass.
constexpr double kDriftSearched_m = 20e-6;
/// Prior of the correction of a hole in the search for a cause.
constexpr double kHoleSearched_m = 100e-6;

/// The indices with the largest values, largest first.
std::vector<std::size_t> largest(const std::vector<double>& values, std::size_t most) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return values[a] > values[b]; });
  order.resize(std::min(most, order.size()));
  return order;
}

/// Keeps `found` if it explains the residuals better than `best`.
void keep_better(LikelyCause& best, Cause cause, const Result<Statistics>& found,
                 const std::string& text) {
  if (found && found->degrees_of_freedom > 0.0 && found->chi2_per_dof < best.chi2_per_dof_without) {
    best = {cause, text, found->chi2_per_dof};
  }
}

/// The observations without all passes that have the position and tool of the given pass.
Observations without_clamping(const Observations& all, std::size_t pass) {
  const std::size_t position = all.passes[pass].position, tool = all.passes[pass].tool;
  Observations rest = all;
  for (std::size_t i = all.passes.size(); i-- > 0;) {
    if (all.passes[i].position == position && all.passes[i].tool == tool) {
      rest = without_pass(rest, i);
    }
  }
  return rest;
}

void try_drift(LikelyCause& best, const Observations& o, const SolveOptions& options) {
  NuisanceOptions with_drift = nuisance_options(options);
  with_drift.u_rate_of_every_pass_m = kDriftSearched_m;
  const bool all_pairs = std::all_of(o.passes.begin(), o.passes.end(),
                                     [](const PassObservation& p) { return p.pair.has_value(); });
  keep_better(best, Cause::Drift, whole_statistics(o, with_drift),
              all_pairs ? "the drift is not linear within a pair of passes: wait until bar and "
                          "machine have the same temperature"
                        : "the bar or the machine drifts during the passes: measure each pass "
                          "forward and backward");
}

void try_holes(LikelyCause& best, const Observations& o, const Solution& solution,
               const SolveOptions& options) {
  constexpr std::size_t kMostTried = 2;
  std::vector<double> chi2(o.bar.O_m.size(), 0.0);
  for (std::size_t i = 0; i < chi2.size(); ++i) {
    for (const PassResiduals& pass : solution.residuals) {
      chi2[i] += pass.hole_chi2[i];
    }
    const auto first = 3 * static_cast<Eigen::Index>(i);
    for (Eigen::Index k = first; k < first + 3; ++k) {
      const double variance_m2 = o.bar.covariance_m2(k, k);
      const double correction_m = solution.bar_correction_m(k);
      if (variance_m2 > 0.0) {
        chi2[i] += correction_m * correction_m / variance_m2;
      }
    }
  }
  for (const std::size_t hole : largest(chi2, kMostTried)) {
    Observations free = o;
    free.bar.covariance_m2.diagonal().segment<3>(3 * static_cast<Eigen::Index>(hole)).array() +=
        kHoleSearched_m * kHoleSearched_m;
    keep_better(best, Cause::Hole, whole_statistics(free, nuisance_options(options)),
                message(hole_name(hole),
                        " is not where its calibration states: look for dirt or damage in the hole "
                        "and at the rods beside it, and calibrate the bar"));
  }
}

void try_measurements(LikelyCause& best, const Observations& o, const Solution& solution,
                      const SolveOptions& options) {
  constexpr std::size_t kMostTried = 3;
  std::vector<double> chi2;
  for (const PassResiduals& pass : solution.residuals) {
    chi2.push_back(pass.chi2);
  }
  for (const std::size_t pass : largest(chi2, kMostTried)) {
    const PassResiduals& residuals = solution.residuals[pass];
    keep_better(best, Cause::Measurement,
                whole_statistics(without_clamping(o, pass), nuisance_options(options)),
                message("measurement ", residuals.measurement,
                        " is left out: the bar moved in its clamping, the stylus changed, or "
                        "touches of one feature are wrong (the largest residual is at ",
                        hole_name(largest(residuals.hole_chi2, 1).front()), "); measure it again"));
  }
}

}  // namespace

LikelyCause likely_cause(const Observations& o, const Solution& solution,
                         const SolveOptions& options) {
  const Statistics& s = solution.statistics;
  if (!(s.chi2_per_dof > s.chi2_per_dof_limit) &&
      !(s.all_chi2_per_dof > s.all_chi2_per_dof_limit)) {
    return {};
  }

  LikelyCause best{Cause::Unknown, "", s.all_chi2_per_dof};
  try_drift(best, o, options);
  try_holes(best, o, solution, options);
  try_measurements(best, o, solution, options);

  const double excess = s.all_chi2_per_dof - 1.0,
               left = std::max(0.0, best.chi2_per_dof_without - 1.0);
  constexpr double kMostLeft = 0.5;
  const bool of_all = s.all_chi2_per_dof > s.all_chi2_per_dof_limit;
  const std::string numbers = message("chi-square per degree of freedom",
                                      of_all ? " (with the calibration of the bar)" : "", " is ",
                                      of_all ? s.all_chi2_per_dof : s.chi2_per_dof, ", at most ",
                                      of_all ? s.all_chi2_per_dof_limit : s.chi2_per_dof_limit);
  if (best.cause == Cause::Unknown || left > kMostLeft * excess) {
    return {Cause::Unknown,
            numbers +
                ": no single cause explains it; the stated noise of probe and machine is too "
                "small, or the machine has "
                "errors between the nodes",
            best.chi2_per_dof_without};
  }
  best.text = message(numbers, ", and ", best.chi2_per_dof_without, " if ", best.text);
  return best;
}

}  // namespace abbe::calib::mfb
