#pragma once
/// Stage two: errors of ball centres in, a model with uncertainty out.
///   ols        least squares, plain; covariance for the noise balls share, s from the residuals.
///   ridge      shrinks everything but the constants, amount by marginal likelihood.
///   bayes-pose the default: priors by order, shared noise of Ball1 and random pose rotations, their sizes by
///              marginal likelihood (prior.hpp); what the machine's errors do to spheres and blocks is in the
///              design when their touches are there. So is slow noise (noise.hpp) in the covariance of the
///              balls, where the data are e^2 times as likely with it.
///   lasso, mcp, scad  as in [Li OMM]: plain monomials in mm, ncvreg's semantics, lambda and gamma by
///              cross-validation; covariance by bootstrap (see CovarianceKind).
/// Not estimable from touches: a rotation of V about Ball1 common to all positions (observe.hpp). It is set
/// to what the blocks say (gauge Ball1-blocks), and its uncertainty is in the covariance. So are errors of
/// the array that all positions share (artefact_rows.hpp): estimates are c = K y with the hyper-parameters
/// fixed, which makes T (K A)(K A)^T T^T of them ([GUM] 5.1.2 eq. (10)), T: gauge; the bootstrap draws them
/// once a run. The array is not estimated: c is the same whatever its uncertainty. What its errors leave in
/// the residuals is in s and w as well and counts twice. Not in the covariance: that hyper-parameters are
/// estimates (of nearly coplanar positions, a twentieth of the tilt of [Li OMM], the likelihood can take
/// slopes of V for pose rotations), and that a machine is no polynomial.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "abbe/calib/evemu/noise.hpp"
#include "abbe/calib/evemu/prior.hpp"
#include "abbe/calib/sparse/folds.hpp"
#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib::evemu {

enum class Estimator { Ols, Ridge, BayesPose, Lasso, Mcp, Scad };
[[nodiscard]] std::string_view name(Estimator);
[[nodiscard]] std::optional<Estimator> estimator(std::string_view name);

/// Bootstrap: seeded, parametric, by position: noise is drawn anew with the estimated s and w
/// around the fitted model, lambda and gamma stay; no bias is in it, and penalised estimates have
/// one.
enum class CovarianceKind { Analytic, Bootstrap };
[[nodiscard]] std::string_view name(CovarianceKind);

/// How rows are held out to choose lambda and gamma. Folds over single rows, as in [Li OMM], let a
/// fit see the noise it is judged by: the components of a ball share their touches, the balls of a
/// position share Ball1.
enum class FoldsBy { Position, Ball, Row };
[[nodiscard]] std::string_view name(FoldsBy);
[[nodiscard]] std::optional<FoldsBy> folds_by(std::string_view name);

/// lambda and gamma, with the surface they were chosen from.
struct SparseChoice {
  std::vector<double> lambda;  ///< the path down to the chosen one, which is last [mm]
  double gamma = 3.7;
  std::vector<double> all_lambda, all_gamma;
  Eigen::MatrixXd
      error_mm2;  ///< mean squared held-out error, all_lambda x all_gamma; NaN: not reached
  double curvature =
      0.0;  ///< smallest eigenvalue of sparse::convexity at the choice; < 0: other minima
            ///< may be near
};

struct SparseOptions {
  FoldsBy folds = FoldsBy::Position;
  std::optional<sparse::Folds>
      given_folds{};  ///< set: these, for 3 rows of every observation in their order
  /// Grid to choose from; empty: the one of [Li OMM], 100 lambdas 1e-1 .. 1e-10 mm, 50 gammas up to
  /// 100.
  std::vector<double> lambda{}, gamma{};
  std::uint64_t seed = 1;                ///< of the bootstrap, and of folds over rows
  int bootstrap_runs = 100;              ///< a standard deviation to 7 %; at least 2
  std::optional<SparseChoice> chosen{};  ///< set: no search
  /// Of the path to the chosen lambda, in the fit and in every refit: what ends before it is
  /// NotConverged. The search has the 10,000 of ncvreg; with those, one of eight refits without a
  /// position ended early.
  long max_sweeps = 1'000'000;
};

struct SolveOptions {
  Estimator estimator = Estimator::BayesPose;
  /// Ridge and bayes-pose, when there are touches: rows through the touched points. Off: through
  /// the centres alone, as in [Li OMM] and as for all other estimators.
  bool use_touches = true;
  SparseOptions sparse{};
};

struct ResidualFigures {
  double mean_abs_m = 0.0;  ///< of the components
  double rms_m = 0.0;
  double max_abs_m = 0.0;
};

struct Statistics {
  std::size_t positions = 0, balls = 0;  ///< balls: readings over all positions
  std::size_t observations = 0;  ///< components, without those of Ball1, which are 0 by definition
  std::size_t unknowns = 0;
  std::size_t rank = 0;               ///< of the design with columns of unit length
  double condition = 0.0;             ///< the same, within its rank
  double effective_parameters = 0.0;  ///< degrees of freedom the coefficients spend; rank for ols
  double degrees_of_freedom = 0.0;    ///< observations - those of coefficients and pose rotations
  double s_m = 0.0;                   ///< noise of a ball centre per coordinate
  double w_rad = 0.0;                 ///< random pose rotation per axis; 0 where not estimated
  double slow_noise_m = 0.0;          ///< of slow noise per coordinate, beside s_m (noise.hpp)
  double chi2_per_dof = 0.0;          ///< of whitened residuals over s; 0 without s
  ResidualFigures before, after;
  int iterations = 0;
};

/// How a rotation reference went with the model.
struct ReferenceFit {
  std::size_t points = 0;  ///< used
  std::vector<std::size_t>
      outside;        ///< numbers, from 1, of points outside the balls' hull: not used
  double chi2 = 0.0;  ///< of the residuals after turning and moving
  double dof = 0.0;
  double widened = 1.0;  ///< what the rotation's covariance was multiplied with for it
};

/// The rotation about Ball1 that no touch can see.
struct MeanRotation {
  /// What the estimate had before it was set to the blocks' direction: with block touches, the
  /// prior's choice; with errors only, the mean of the pose rotations found.
  Vector3 removed_rad = Vector3::Zero();
  Matrix3 cov_rad2 = Matrix3::Zero();  ///< is in the model's covariance
  bool referenced = false;             ///< known from elsewhere: the model is more than a shape
  std::optional<ReferenceFit> reference{};  ///< of with_rotation_reference()
};

struct Solution {
  VolumetricModel model;
  Eigen::VectorXd raw_c_m;  ///< coefficients before V(Ball1) = 0 and the rotation were set
  Estimator estimator = Estimator::BayesPose;
  CovarianceKind covariance = CovarianceKind::Analytic;
  std::optional<HyperParameters> hyper;
  std::optional<SparseChoice> sparse;
  /// Observed minus fitted, pose rotations taken out, in the order of the observations; Ball1:
  /// zero.
  std::vector<Vector3> residuals_m;
  std::vector<Vector3> pose_rotations_rad;  ///< estimated, by position; empty where not modelled
  MeanRotation rotation;
  std::optional<ArtefactUncertainty> artefact;  ///< as observed; in the model's covariance
  /// Observations::slow_noise as given or, by bayes-pose from touches, as estimated.
  double slow_noise = 0.0;
  Statistics statistics;
};

/// The scaled design over the readings.
[[nodiscard]] Result<ScaledDesign> design_of(const Observations&);

/// Errors of sparse::grid_search for lasso, mcp and scad (folds that are not for these rows),
/// RankDeficient for ols when the positions do not determine every combination, TooFewObservations,
/// DegenerateGeometry when the balls enclose no volume.
[[nodiscard]] Result<Solution> solve(const Observations&, const SolveOptions& = {});

/// V known independently at some readings, relative to each other in the machine's directions.
struct RotationReference {
  std::span<const BallError>
      points;             ///< position and ball do not count; >= 3 in the hull, not on a line
  double sigma_m = 1e-6;  ///< standard uncertainty of V, per component, independent
};
/// The same solution turned onto the reference, which may have its own origin. The rotation omega
/// fits r = V_reference - V_model by generalised least squares, omega = K r, over the noise of the
/// reference and what the model's shape may be off at its points (B C B^T). Both are then in the
/// covariance:
///     C' = (1 - G K B) C (1 - G K B)^T + sigma^2 G K K^T G^T,    G: c of a rotation about Ball1.
/// Points outside the balls' hull (by 2 % of its size) are left out and named. Residuals larger than a right
/// reference has once in 1000 widen the rotation's covariance by chi-square per degree of freedom; beyond 4
/// they are BadInput: another frame, sign or artefact. That test sees what the machine's errors have beside a
/// rigid motion; any reference of a machine that has nothing else passes.
[[nodiscard]] Result<Solution> with_rotation_reference(Solution, const RotationReference&);

}  // namespace abbe::calib::evemu
