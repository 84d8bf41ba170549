#pragma once
/// Monte Carlo check of the covariance of an identification: the whole chain from touches to tables
/// is repeated with drawn errors. Each trial draws the noise of every touch (probe along the
/// normal, machine in three axes), the calibration of the bar, alpha and the temperatures; extracts
/// features and points of interest of every pass; finds the poses, and estimates the errors with
/// the estimator of the identification.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "abbe/calib/mfb/solve/solve.hpp"

namespace abbe::calib::mfb {

struct MonteCarloOptions {
  std::size_t trials = 1000;               ///< at least 2
  std::uint64_t seed = 1;                  ///< the same seed gives the same result
  std::function<void(double)> progress{};  ///< called with the share done, after each trial
};

struct MonteCarlo {
  std::size_t trials = 0;
  std::uint64_t seed = 0;
  /// Of the parameters of the model, in the order of ParameterLayout; 0 where the datum fixes them.
  /// mean_error: mean of the trials minus the parameters of the solution, which the simulated
  /// machine has: it shows what the linearisation neglects.
  Eigen::VectorXd mean_error, standard_deviation;
  /// Mean over the parameters of standard_deviation / u of the first order; 1: they agree.
  double mean_ratio = 0.0, smallest_ratio = 0.0, largest_ratio = 0.0;
  /// Expected scatter of the ratio of one parameter: 1 / sqrt(2 (trials - 1)).
  double scatter_of_ratio = 0.0;
};

/// `observations` and `solution` belong together. BadInput for fewer than 2 trials.
[[nodiscard]] Result<MonteCarlo> monte_carlo(const Observations&, const Solution&,
                                             const SolveOptions& = {},
                                             const MonteCarloOptions& = {});

}  // namespace abbe::calib::mfb
