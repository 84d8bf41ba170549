#pragma once
/// Stage two: the 21 errors from the deviations of the points of interest, with their covariance.
///
/// Simultaneous: one weighted least-squares adjustment of all passes. Unknowns: the tables in datum
/// G2 and the squareness errors; per position the pose (3 translations, 3 rotations about the bar
/// axes through the middle of the bar; roll with a prior), for each further tool 3 constants, for
/// each pair 3 rates of drift and 3 constants of its second pass, an error of the temperature with
/// prior; for all positions the corrections of O_i and of alpha with the calibration as prior.
/// Weight: the full covariance of the points of a pass, D C D^T, C: noise of the touches. Unknowns
/// of a position are eliminated by QR; the rest by QR of the whitened, column-scaled rows.
///
/// Sequential ([Viprey 2016]): angular errors from differences of measurements, then translations,
/// then squareness from the diagonals; cross terms of the axes already known are subtracted before.
/// Order X, Y, Z from workpiece to tool only. Slopes of EAX are lost. Passes of a pair are
/// averaged.
///
/// Datum: every table 0 at the reference of its axis, straightness 0 at both ends, slope of EAX
/// free. Not estimable: constants and rigid motions. Units: m, rad; k = 1.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

enum class Estimator { Simultaneous, Sequential };
/// "simultaneous", "sequential".
[[nodiscard]] std::string_view name(Estimator);
[[nodiscard]] std::optional<Estimator> estimator_named(std::string_view);

struct SolveOptions {
  Estimator estimator = Estimator::Simultaneous;
  /// Standard uncertainty of the roll of the bar as its reference plane shows it. 100 urad.
  double u_roll_rad = 100e-6;
  /// An error with a larger standard uncertainty at one of its nodes is one that the measurements
  /// cannot show: a complete plan gives 0.5 um and 3 urad, a plan without the position that shows
  /// an error 100 urad and more.
  double most_u_m = 5e-6, most_u_rad = 20e-6;
};

/// Parts of the covariance of an error, each as a standard uncertainty: the largest over its nodes.
struct Budget {
  std::string name;  ///< "EXX"
  double u = 0.0;    ///< of all parts; m or rad
  double probe = 0.0, machine = 0.0, bar = 0.0;
  double expansion = 0.0;    ///< uncertainty of alpha
  double temperature = 0.0;  ///< of the bar in each position
  double roll = 0.0;         ///< prior of the roll
  /// Contained in probe and machine: the part of u that the estimation of the drift adds; 0 without
  /// pairs.
  double drift = 0.0;
};

struct Statistics {
  std::size_t observations = 0;  ///< coordinates of points of interest
  std::size_t unknowns = 0;
  std::size_t rank = 0;    ///< of observations and priors, without rounding
  double condition = 0.0;  ///< of the column-scaled rows, nuisances eliminated
  double chi2 = 0.0;       ///< of the observations
  /// Observations less the trace of the hat matrix: unknowns with a prior count in part.
  double degrees_of_freedom = 0.0;
  double chi2_per_dof = 0.0;
  double sigma0 = 0.0;  ///< root of chi2_per_dof
  /// Quantile of chi2_per_dof for 99.9 %. Above it the stated noise does not explain the residuals.
  double chi2_per_dof_limit = 0.0;
  /// Of observations and priors, per degree of freedom, and its quantile: also shows corrections of
  /// the bar that contradict its calibration. The sequence has no priors.
  double all_chi2_per_dof = 0.0, all_chi2_per_dof_limit = 0.0;
};

struct PassResiduals {
  std::string measurement;
  double chi2 = 0.0, degrees_of_freedom = 0.0;
  std::vector<Vector3> O_m;       ///< residual of each O_i, bar axes
  std::vector<Vector3> before_m;  ///< the same without errors of the machine; pose estimated
  std::vector<Vector3> u_O_m;     ///< standard uncertainty of each O_i from the noise
  std::vector<double> hole_chi2;  ///< of each hole, from its own covariance
};

/// Estimated drift of a pair: displacement of the readings, machine axes, per duration of one pass.
struct PairDrift {
  std::string forward, backward;  ///< names of the measurements
  Vector3 rate_m = Vector3::Zero(), u_rate_m = Vector3::Zero();
  Vector3 step_m = Vector3::Zero();  ///< constant of the second pass
};

struct Solution {
  Eigen::VectorXd U;  ///< parameters of the model, datum G2
  Eigen::MatrixXd covariance;
  Statistics statistics;
  std::vector<BarPose> poses;  ///< by position, as estimated
  std::vector<PairDrift> drift;
  std::vector<PassResiduals> residuals;  ///< by pass
  Eigen::VectorXd bar_correction_m;      ///< of the calibrated O_i, 3N
  double alpha_correction_per_K = 0.0;
  std::vector<Budget> budget;  ///< 21 errors
};

/// RankDeficient: the text names the errors whose uncertainty exceeds the limits of the options.
/// For Estimator::Sequential NotApplicable: another order of the axes, or a role that no
/// measurement has.
[[nodiscard]] Result<Solution> solve(const Observations&, const SolveOptions& = {});

}  // namespace abbe::calib::mfb
