#pragma once
/// Monte Carlo check of the covariance of an identification: the computation from touches to tables
/// is repeated with random errors. Each trial draws the noise of every touch (probe along the
/// normal, machine in three axes), the calibration of the bar, alpha and the temperatures. It then
/// extracts features and points of interest of every pass, finds the poses, and estimates the
/// errors with the estimator of the identification.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "abbe/calib/mfb/solve/solve.hpp"

namespace abbe::calib::mfb {

struct MonteCarloOptions {
  std::size_t trials = 1000;               ///< at least 2
  std::uint64_t seed = 1;                  ///< the same seed gives the same result
  std::function<void(double)> progress{};  ///< called after each trial with the fraction done
};

struct MonteCarlo {
  std::size_t trials = 0;
  std::uint64_t seed = 0;
  /// For each parameter of the model, in the order of ParameterLayout; 0 where the datum fixes it.
  /// mean_error: mean of the trials minus the parameters of the solution, with which the machine is
  /// simulated. It is the error by linearisation.
  Eigen::VectorXd mean_error, standard_deviation;
  /// Ratio standard_deviation / u of the first-order covariance, over the parameters. 1: they
  /// agree.
  double mean_ratio = 0.0, smallest_ratio = 0.0, largest_ratio = 0.0;
  /// Expected scatter of the ratio of one parameter: 1 / sqrt(2 (trials - 1)).
  double scatter_of_ratio = 0.0;
};

/// Runs the trials. `solution` must be that of `observations`. BadInput for fewer than 2 trials.
[[nodiscard]] Result<MonteCarlo> monte_carlo(const Observations&, const Solution&,
                                             const SolveOptions& = {},
                                             const MonteCarloOptions& = {});

}  // namespace abbe::calib::mfb
