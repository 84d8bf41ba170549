#pragma once
/// Stage two: computes the parameters and their covariance from weighted observations. The
/// adjustment minimises
///     |W (A U - y)|^2 + mu |K U|^2
/// in square-root form (estimation/information.hpp; the pseudo-inverse of [Sanders 2023] eq. (7)
/// gives the same fit in another datum). A: design matrix, U: parameters, y: observations, W:
/// diagonal, W^2: weights, K U = 0: datum conditions (model_datum.hpp). These conditions can be
/// satisfied without changing the residuals. Therefore they hold exactly, and the solution does not
/// depend on mu (estimation/datum.hpp).
///
/// Covariance, with H = A^T W^2 A and Q = (H + mu K^T K)^-1:
///     Cov = Q H Q                      if the weights are 1/sigma^2
///     Cov = Q (A^T W^2 C W^2 A) Q      for other weights, C the covariance of the observations
/// This is [Sanders 2023] eq. (12) with two corrections: the rotation into machine coordinates is
/// already part of sigma_m, and the alignment is estimated together with U. The diagonal contains
/// variances.
///
/// A relative error common to all ranges (Noise::u_scale) shifts row i by s_i and U by dU:
///     s_i = direction_i . (position_i - tracker),   dU = Q A^T W^2 s
/// u_scale^2 dU dU^T is added to the covariance after the multiplication with
/// Statistics::variance_factor.
///
/// An offset d of all ranges with the prior N(0, u^2), u = Noise::u_range_offset_m, is one more
/// unknown with the column C (its derivative) and the residuals r:
///     S = C^T W^2 C - C^T W^2 A Q A^T W^2 C,   d = C^T W^2 r / (S + 1/u^2)
///     U changes by -Q A^T W^2 C d
/// Errors of the machine that depend on two axes (two_axis_errors.hpp) are nine more such columns
/// if the residuals show them. The drift of the tracker (tracker_drift.hpp) enters as further
/// columns C, with the information of the visits of nests and the prior in place of 1/u^2.
///
/// The header of VolumetricModel states what is not estimable. Rank and condition refer to the
/// column-scaled data, without the datum.

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/model/offset_in_model.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/calib/otf/observe/observe.hpp"
#include "abbe/calib/otf/run/encoder_log.hpp"
#include "abbe/calib/otf/run/two_axis_errors.hpp"
#include "abbe/calib/otf/solve/backlash.hpp"

namespace abbe::calib::otf {

/// Text for files: "direct" (one linear adjustment without iteration) or "converged".
[[nodiscard]] std::string_view stop_reason(Estimator);

/// Information of a set of rows about the unknowns of Observations.
struct RowInformation {
  estimation::Information data;  ///< rows with the weights `weight`
  /// information of the rows with the weights weight^2 sigma^2, whose matrix is the covariance of
  /// A^T W^2 y caused by the noise of the rows; absent if all weights are 1/sigma^2, because it
  /// then equals `data`
  std::optional<estimation::Information> noise;

  explicit RowInformation(std::size_t unknowns) : data(unknowns) {}
  RowInformation& operator+=(const RowInformation&);
};
/// Information of the rows for which `take` returns true; of all rows if `take` is empty. The rows
/// are added in a fixed order: the same input gives bit-identical results.
[[nodiscard]] RowInformation information_of(
    const Observations&, const std::function<bool(const Observation&)>& take = {});

/// Parameters U in datum G2, with their covariance caused by the noise of the rows. With
/// Observations::smoothness, `rank` is defined as Statistics::rank.
using Adjustment = estimation::DatumSolution;
/// Adjusts the rows. RankDeficient if the rank defect of the data is larger than the number of
/// datum conditions. The text names parameters that are not determined.
[[nodiscard]] Result<Adjustment> adjust(const RowInformation&, const Observations&,
                                        double datum_weight = 1.0);

struct ResidualStatistics {
  double mean_abs_m = 0.0;
  double rms_m = 0.0;
  double max_abs_m = 0.0;
  double weighted_rms = 0.0;  ///< root mean square of residual / sigma
};

/// One residual per row, in row order.
struct Residuals {
  std::vector<double> before_m;  ///< y of each row: after the alignment, without a model
  std::vector<double> after_m;
};

struct Statistics {
  std::size_t samples = 0, lost_samples = 0, segments = 0, segments_used = 0;
  std::size_t observations = 0;  ///< number of rows
  std::size_t unknowns = 0;      ///< number of columns
  /// Rank of the data. With a prior for smooth tables: the number of combinations of the unknowns
  /// that the data determine, trace(Q A^T W^2 A), rounded.
  std::size_t rank = 0;
  std::size_t datum_conditions = 0;
  std::size_t degrees_of_freedom = 0;  ///< observations - rank
  double condition = 0.0;
  double chi2 = 0.0;
  double chi2_per_dof = 0.0;
  double sigma0 = 0.0;       ///< sqrt(chi2_per_dof)
  double correlation = 1.0;  ///< see ResidualNoise::correlation
  /// Factor applied to the covariance [Birge 1932]: chi2_per_dof times `correlation` if this
  /// product exceeds the 99.9 % quantile of chi2/dof for the stated uncertainties, else 1. After
  /// prewhitening both values are those of the prewhitened residuals.
  double variance_factor = 1.0;
  /// Autocorrelation of the noise from segment to segment along a2 and a3 that prewhitening
  /// removed; 0 without prewhitening.
  std::array<double, 2> noise_correlation{};
  ResidualStatistics before;  ///< statistics of Residuals::before_m
  ResidualStatistics after;   ///< statistics of Residuals::after_m
  int iterations = 0;         ///< number of adjustments
  int alignment_iterations = 0;
  double alignment_rms_m = 0.0;
};

/// Estimated offset of all ranges; 0 if Noise::u_range_offset_m is 0.
struct RangeOffset {
  double value_m = 0.0;
  double u_m = 0.0;
};

/// Clock and statistics of the rows from scale readings (along_rows.hpp).
struct Synchronisation {
  ClockMap clock;
  double u_offset_s = 0.0;  ///< 0: the clocks are known
  double u_drift = 0.0;
  std::size_t rows = 0;  ///< number of rows along the direction of travel
  /// chi2 per degree of freedom of these rows, with their stated uncertainties.
  double chi2_per_dof = 0.0;
  /// Factor of the stated standard uncertainties with which the rows were used; at least 1.
  double sigma_factor = 1.0;
};

/// The fit from which the model was made; input of with_misfit().
struct FitOfRows {
  Eigen::VectorXd U;  ///< all unknowns of Observations
  /// Residuals of the rows after subtraction of range offset, drift and errors of two axes.
  std::vector<double> residual_m;
  Eigen::MatrixXd covariance_of_noise;  ///< part of the covariance of U that is caused by the noise
                                        ///< of the rows
  /// Time in s over which the noise is correlated; for segments without times in units of a
  /// segment.
  double correlation_time = 0.0;
  std::optional<TwoAxisErrors> two_axes{};
};

struct Solution {
  Estimator estimator = Estimator::TwoStep;
  VolumetricModel model;            ///< datum G2, no rigid unknowns, mean of both directions
  Vector6 rigid = Vector6::Zero();  ///< tx ty tz [m], rx ry rz [rad] relative to the alignment
  Eigen::VectorXd clock{};  ///< corrections of the clock unknowns, if the observations have them
  Eigen::MatrixXd covariance_with_rigid;  ///< covariance of all unknowns of Observations
  Adjustment adjustment;                  ///< adjustment of the rows alone: white noise, no range
                                          ///< offset
  RigidTransform T_machine_tracker;
  Statistics statistics;
  /// after_m: model, range offset, drift and errors of two axes subtracted
  Residuals residuals;
  RangeOffset range_offset;
  std::optional<TwoAxisErrors> two_axes{};           ///< not part of the model, but of its misfit
  std::optional<Synchronisation> synchronisation{};  ///< only with scale readings
  std::vector<Backlash> backlash{};                  ///< only with Options::backlash
  std::optional<TrackerDrift> drift{};               ///< only with Options::nests
  std::optional<Smoothness> smoothness{};            ///< only with Options::smoothness
  /// The range offset, for combining this run with others that have the same offset. Only with
  /// Noise::u_range_offset_m and without nests (with nests it is estimated together with the
  /// drift).
  std::optional<OffsetInModel> offset_in_model{};
  FitOfRows fit{};
};
/// The observations after subtraction of the estimated range offset, the drift of the tracker and
/// the errors of two axes.
[[nodiscard]] Observations without_run_effects(Observations, const Solution&);

/// Finds the misfit in the residuals and returns the solution with it (VolumetricModel::misfit()),
/// also in the covariance of the model. Adds notes about it to the observations. The solution is
/// unchanged if there is no misfit.
[[nodiscard]] Result<Solution> with_misfit(Solution, Observations&);

[[nodiscard]] Result<Solution> solve(const Observations&, const Options& = {});
/// solve() with information_of() all rows, if it is already known.
[[nodiscard]] Result<Solution> solve(const Observations&, const RowInformation&, const Options&);

}  // namespace abbe::calib::otf
