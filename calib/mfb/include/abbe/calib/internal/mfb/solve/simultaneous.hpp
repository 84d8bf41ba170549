#pragma once
/// The simultaneous adjustment (solve.hpp) as separate functions for observe, plan and Monte Carlo.

#include <vector>

#include "abbe/calib/internal/mfb/solve/position_system.hpp"
#include "abbe/calib/mfb/solve/solve.hpp"

namespace abbe::calib::mfb {

struct WholeSystem {
  std::vector<NominalTouch> touches;
  SharedUnknowns shared;
  std::vector<PositionSystem> positions;
};
[[nodiscard]] Result<WholeSystem> whole_system(const Observations&, const NuisanceOptions&);

/// Estimate of the shared unknowns.
struct SharedEstimate {
  Eigen::VectorXd x;
  RowMajorRows root;  ///< upper triangle; covariance = root root^T
  Eigen::MatrixXd covariance;
  double rest = 0.0;       ///< sum of squares of the residuals of observations and priors
  std::size_t defect = 0;  ///< number of combinations that the data leave undetermined
  double condition = 0.0;
};
/// `data` contains the priors of the shared unknowns. Undetermined combinations get a prior of 1 m
/// or 1 rad, so that their uncertainty is large instead of undefined.
[[nodiscard]] SharedEstimate estimate_of(estimation::Information data, const SharedUnknowns&);
[[nodiscard]] SharedEstimate estimate_of(const WholeSystem&);

/// The rows of all positions.
[[nodiscard]] estimation::Information information_of(const WholeSystem&);

[[nodiscard]] NuisanceOptions nuisance_options(const SolveOptions&);
[[nodiscard]] Result<Solution> solve_simultaneously(const Observations&, const NuisanceOptions&);

/// Statistics of a simultaneous adjustment; in less time than a solution.
[[nodiscard]] Result<Statistics> whole_statistics(const Observations&, const NuisanceOptions&);
/// Sum of squares of all whitened residuals, those of the priors included: the value that the
/// adjustment minimises.
[[nodiscard]] Result<double> whole_chi2(const Observations&, const NuisanceOptions&);

/// Returns RankDeficient if an uncertainty exceeds the limits of the options; the text names the
/// errors.
[[nodiscard]] Result<void> check_shown(const Observations&, const Solution&, const SolveOptions&);

}  // namespace abbe::calib::mfb
