#pragma once
/// Stage two: estimates the 21 errors, with their covariance, from the deviations of the points of
/// interest.
///
/// Simultaneous: one weighted least-squares adjustment of all passes. Unknowns: the tables in datum
/// G2 and the squareness errors; per position the pose (3 translations, 3 rotations about the bar
/// axes through the middle of the bar; roll with a prior), for each further tool 3 constants, for
/// each pair 3 rates of drift and 3 constants of its second pass, an error of the temperature with
/// prior; for all positions the corrections of O_i and of alpha with the calibration as prior.
/// Weight: the full covariance of the points of a pass, D C D^T, C: noise of the touches. Unknowns
/// of a position are eliminated by QR; the rest by QR of the whitened, column-scaled rows.
///
/// Sequential ([Viprey 2016]): first angular errors from differences of measurements, then
/// translations, then squareness from the diagonals. Effects of errors that are already known are
/// subtracted in each step. Only for the axis order X, Y, Z from workpiece to tool. The slope of
/// EAX is not determined. Passes of a pair are averaged.
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
/// Returns "simultaneous" or "sequential".
[[nodiscard]] std::string_view name(Estimator);
[[nodiscard]] std::optional<Estimator> estimator_named(std::string_view);

struct SolveOptions {
  Estimator estimator = Estimator::Simultaneous;
  /// Standard uncertainty of the roll of the bar as determined by its reference plane.
  double u_roll_rad = 100e-6;
  /// An error whose standard uncertainty is larger at one of its nodes counts as not determined. A
  /// complete plan gives 0.5 um and 3 urad; without a position that is needed for an error, its
  /// uncertainty is 100 urad and more.
  double most_u_m = 5e-6, most_u_rad = 20e-6;
};

/// Contributions to the standard uncertainty of an error, each the largest value over its nodes.
struct Budget {
  std::string name;  ///< such as "EXX"
  double u = 0.0;    ///< combined standard uncertainty; m or rad
  double probe = 0.0, machine = 0.0, bar = 0.0;
  double expansion = 0.0;    ///< caused by the uncertainty of alpha
  double temperature = 0.0;  ///< caused by the temperature of the bar in each position
  double roll = 0.0;         ///< caused by the prior of the roll of the bar
  /// Part of u that is caused by estimating the drift; it is contained in `probe` and `machine`. 0
  /// without pairs.
  double drift = 0.0;
};

struct Statistics {
  std::size_t observations = 0;  ///< number of coordinates of points of interest
  std::size_t unknowns = 0;
  std::size_t rank = 0;    ///< rank of observations and priors
  double condition = 0.0;  ///< condition number of the column-scaled rows after elimination of the
                           ///< nuisances
  double chi2 = 0.0;       ///< chi-square of the observations
  /// Observations minus the trace of the hat matrix. An unknown with a prior counts only in part.
  double degrees_of_freedom = 0.0;
  double chi2_per_dof = 0.0;
  double sigma0 = 0.0;  ///< square root of chi2_per_dof
  /// 99.9 % quantile of chi2_per_dof. If chi2_per_dof is larger, the stated noise does not explain
  /// the residuals.
  double chi2_per_dof_limit = 0.0;
  /// Chi-square of observations and priors per degree of freedom, and its quantile. It is also
  /// large if corrections of the bar contradict its calibration. Estimator::Sequential has no
  /// priors.
  double all_chi2_per_dof = 0.0, all_chi2_per_dof_limit = 0.0;
};

struct PassResiduals {
  std::string measurement;
  double chi2 = 0.0, degrees_of_freedom = 0.0;
  std::vector<Vector3> O_m;       ///< residual of each O_i, bar axes
  std::vector<Vector3> before_m;  ///< residuals if the machine had no errors; pose estimated
  std::vector<Vector3> u_O_m;     ///< standard uncertainty of each O_i from the noise
  std::vector<double> hole_chi2;  ///< chi-square of each hole, with the covariance of this hole
                                  ///< alone
};

/// Estimated drift of a pair of passes: displacement of the readings along the machine axes during
/// one pass.
struct PairDrift {
  std::string forward, backward;  ///< names of the measurements
  Vector3 rate_m = Vector3::Zero(), u_rate_m = Vector3::Zero();
  Vector3 step_m = Vector3::Zero();  ///< constant displacement of the second pass
};

struct Solution {
  Eigen::VectorXd U;  ///< parameters of the model, datum G2
  Eigen::MatrixXd covariance;
  Statistics statistics;
  std::vector<BarPose> poses;  ///< by position, as estimated
  std::vector<PairDrift> drift;
  std::vector<PassResiduals> residuals;  ///< in the order of the passes
  Eigen::VectorXd bar_correction_m;      ///< correction of the calibrated O_i, 3N
  double alpha_correction_per_K = 0.0;
  std::vector<Budget> budget;  ///< one entry for each of the 21 errors
};

/// Estimates the errors. RankDeficient: the text names the errors whose uncertainty exceeds the
/// limits of the options. For Estimator::Sequential also NotApplicable: another order of the axes,
/// or no measurement for a role of the sequence.
[[nodiscard]] Result<Solution> solve(const Observations&, const SolveOptions& = {});

}  // namespace abbe::calib::mfb
