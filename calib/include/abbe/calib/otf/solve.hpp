#pragma once
/// Stage two: weighted observations in, parameters with covariance out. Minimises |W (A U -
/// y)|^2 + mu |K U|^2 by normal equations ([Sanders 2023] eq. (7), whose pseudo-inverse gives the
/// same fit in another gauge). Because the combinations K fixes cost nothing, K U = 0 holds exactly
/// and mu does not matter (minimal constraints). Covariance: Cov = Q H Q, Q = (H + mu K^T K)^-1, if
/// weights are 1/sigma^2, else Q (A^T W^2 C W^2 A) Q: [Sanders 2023] eq. (12), corrected for the
/// rotation into machine coordinates (in sigma_m already) and for the alignment, which is estimated
/// along; the diagonal holds variances. What all ranges are off by in common (Noise::u_scale) moves
/// every row by s = direction . (place - tracker), and U by Q A^T W^2 s: u_scale^2 times the square
/// of that is added, after the factor below. An offset d of all ranges with the prior N(0,
/// u_range_offset^2) is one more unknown with the column C: with S = C^T W^2 C - C^T W^2 A Q A^T
/// W^2 C, d = C^T W^2 r / (S + 1/u^2), and U moves by -Q A^T W^2 C d. Not estimable: see
/// VolumetricModel. Rank and condition are those of the column-scaled data, without the gauge.

#include <Eigen/Core>
#include <functional>
#include <string>
#include <string_view>

#include "abbe/calib/otf/observe.hpp"
#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib::otf {

/// The joint estimator (alignment refined inside the adjustment) will be a further one.
enum class Estimator { TwoStep };
[[nodiscard]] constexpr std::string_view name(Estimator) {
  return "two-step";
}

enum class StopReason { Direct };  ///< Direct: linear problem, solved at once
[[nodiscard]] constexpr std::string_view name(StopReason) {
  return "direct";
}

/// H = A^T W^2 A, g = A^T W^2 y over fit_size() unknowns; additive over observations. Summation in
/// row order: the same input gives the same bits.
struct NormalEquations {
  Eigen::MatrixXd H;  ///< lower triangle, the rest is zero
  Eigen::MatrixXd
      H_noise;  ///< A^T W^2 C W^2 A, lower triangle; equals H where weights are 1/sigma^2
  Eigen::VectorXd g;
  std::size_t rows = 0;

  explicit NormalEquations(std::size_t unknowns);
  void add(std::span<const SparseRows::Entry> row, const Observation&);
  NormalEquations& operator+=(const NormalEquations&);
};
/// Of the rows for which `take` is true; of all if it is empty.
[[nodiscard]] NormalEquations normal_equations(
    const Observations&, const std::function<bool(const Observation&)>& take = {});

struct Adjustment {
  Eigen::VectorXd U;           ///< fit_size(), in gauge G1
  Eigen::MatrixXd covariance;  ///< fit_size() squared
  Eigen::MatrixXd cofactor_Q;  ///< Q: what a change of g does to U
  std::size_t rank = 0;
  std::size_t datum_defect = 0;  ///< what the gauge fixes: 20 for 14 tables
  /// of the column-scaled design within its rank: sqrt of the eigenvalue ratio
  double condition = 0.0;
};
/// RankDeficient with the parameters that are not determined, when the data miss more than the
/// gauge supplies.
[[nodiscard]] Result<Adjustment> adjust(const NormalEquations&, const ParameterLayout&,
                                        double gauge_weight = 1.0);

struct ResidualStatistics {
  double mean_abs_m = 0.0;
  double rms_m = 0.0;
  double max_abs_m = 0.0;
  double weighted_rms = 0.0;  ///< of residual / sigma
};

/// Of every row, in row order.
struct Residuals {
  std::vector<double> before_m;  ///< deviation after the alignment, no model
  std::vector<double> after_m;
};

struct Statistics {
  std::size_t samples = 0, lost_samples = 0, blocks = 0, blocks_used = 0;
  std::size_t observations = 0;  ///< rows
  std::size_t unknowns = 0;      ///< columns
  std::size_t rank = 0;
  std::size_t gauge_conditions = 0;
  std::size_t degrees_of_freedom = 0;  ///< observations - rank
  double condition = 0.0;
  double chi2 = 0.0;
  double chi2_per_dof = 0.0;
  double sigma0 = 0.0;       ///< sqrt(chi2_per_dof)
  double correlation = 1.0;  ///< blocks that carry the information of one, see ResidualNoise
  /// What the covariance was multiplied with: chi2_per_dof times `correlation` where that is more
  /// than the stated uncertainties explain (beyond the 99.9 % quantile of chi2/dof), else 1
  /// [Birge 1932].
  double variance_factor = 1.0;
  ResidualStatistics before;  ///< deviations after the alignment, no model
  ResidualStatistics after;
  int iterations = 0;
  int alignment_iterations = 0;
  double alignment_rms_m = 0.0;
  StopReason stop = StopReason::Direct;
};

/// Offset of all ranges, where Noise::u_range_offset_m gives it a prior; else 0.
struct RangeOffset {
  double value_m = 0.0;
  double u_m = 0.0;
};

struct Solution {
  VolumetricModel model;  ///< gauge G1, rigid unknowns at 0
  Estimator estimator = Estimator::TwoStep;
  Vector6 rigid = Vector6::Zero();  ///< tx ty tz [m], rx ry rz [rad] left over by the alignment
  Eigen::MatrixXd covariance_with_rigid;
  RigidTransform T_machine_tracker;
  Statistics statistics;
  Residuals residuals;  ///< after_m: less the range offset, too
  RangeOffset range_offset;
};

[[nodiscard]] Result<Solution> solve(const Observations&, const Options& = {});

}  // namespace abbe::calib::otf
