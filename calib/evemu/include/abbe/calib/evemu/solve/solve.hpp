#pragma once
/// Stage two: estimates a model with uncertainty from errors of ball centres. Estimators:
///   ols               ordinary least squares; the covariance takes into account that the balls of
///                     a position share the noise of Ball1 (noise.hpp); noise s from the residuals
///   ridge             shrinks all coefficients except the constants, amount by marginal likelihood
///   bayes-pose        the default: priors by order, shared noise of Ball1 and random pose
///                     rotations, their sizes by marginal likelihood (prior.hpp). With touches, the
///                     effect of the machine's errors on spheres and blocks is in the design, and
///                     slow noise (noise.hpp) is in the covariance of the balls if the data are e^2
///                     times as likely with it
///   lasso, mcp, scad  as in [Li OMM]: plain monomials in mm, semantics of ncvreg, lambda and gamma
///                     by cross-validation; covariance by bootstrap (see CovarianceKind)
///
/// Not estimable from touches: a rotation of V about Ball1 common to all positions (observe.hpp).
/// This rotation is set to that of the measured blocks (datum Ball1-blocks), and its uncertainty is
/// in the covariance.
///
/// Errors of the array that all positions share (artefact_rows.hpp) are not estimated: the
/// coefficients c do not depend on their uncertainty. With the hyper-parameters fixed, c is linear
/// in the observations, c = K y, and the array's errors add to the covariance of c ([GUM] 5.1.2 eq.
/// (10); A: artefact_rows(), T: transformation to the datum)
///     T (K A)(K A)^T T^T.
/// The bootstrap draws errors of the array once per run. Errors of the array also enlarge the
/// residuals, and with them s and w; their effect is therefore counted twice.
///
/// Hyper-parameters are not exactly known: noise and errors of the machine may explain the data
/// almost equally well (a flat likelihood). The covariance of bayes-pose is therefore enlarged
/// until the rms uncertainty over the balls is not smaller than the largest difference to an
/// estimate with comparable hyper-parameters (Statistics::comparable_m). Most runs need no
/// enlargement.
///
/// Not in the covariance: the rest of the uncertainty of the hyper-parameters, and errors of the
/// machine that are not polynomials.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "abbe/calib/evemu/solve/noise.hpp"
#include "abbe/calib/evemu/solve/prior.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/calib/sparse/folds.hpp"

namespace abbe::calib::evemu {

enum class Estimator { Ols, Ridge, BayesPose, Lasso, Mcp, Scad };
[[nodiscard]] std::string_view name(Estimator);
[[nodiscard]] std::optional<Estimator> estimator(std::string_view name);

/// Bootstrap: seeded, parametric, by position. Each run draws noise with the estimated s and w
/// around the fitted model; lambda and gamma stay fixed. The bias of penalised estimates is not
/// included.
enum class CovarianceKind { Analytic, Bootstrap };
[[nodiscard]] std::string_view name(CovarianceKind);

/// How rows are held out to choose lambda and gamma. With folds over single rows, as in [Li OMM],
/// the rows held out share noise with the fitted rows, and the held-out error is too small: the
/// components of a ball share their touches, the balls of a position share Ball1.
enum class FoldsBy { Position, Ball, Row };
[[nodiscard]] std::string_view name(FoldsBy);
[[nodiscard]] std::optional<FoldsBy> folds_by(std::string_view name);

/// The chosen lambda and gamma, with the cross-validation errors from which they were chosen.
struct SparseChoice {
  std::vector<double> lambda;  ///< the path down to the chosen lambda, which is the last [mm]
  double gamma = 3.7;
  std::vector<double> all_lambda, all_gamma;
  /// Mean squared held-out error, all_lambda x all_gamma; NaN: a path ended before this lambda.
  Eigen::MatrixXd error_mm2;
  /// Smallest eigenvalue of sparse::convexity at the chosen lambda and gamma; if negative, the
  /// objective may have other minima near the solution.
  double curvature = 0.0;
};

struct SparseOptions {
  FoldsBy folds = FoldsBy::Position;
  /// If set, used instead of `folds`: the fold of each of the 3 rows (components) of every
  /// observation, in the order of the observations.
  std::optional<sparse::Folds> given_folds{};
  /// Grid to choose from; empty: the grid of [Li OMM], 100 lambdas 1e-1 .. 1e-10 mm, 50 gammas up
  /// to 100.
  std::vector<double> lambda{}, gamma{};
  std::uint64_t seed = 1;                ///< seed of the bootstrap, and of random folds over rows
  int bootstrap_runs = 100;              ///< 100 give a standard deviation to 7 %; at least 2
  std::optional<SparseChoice> chosen{};  ///< if set, used without a search
  /// Limit of coordinate-descent sweeps of the path to the chosen lambda, in the fit and in every
  /// refit; a path that ends before that lambda is NotConverged. The search for lambda uses 10,000
  /// sweeps as ncvreg does; with so few, one of eight refits without a position ended early.
  long max_sweeps = 1'000'000;
};

struct SolveOptions {
  Estimator estimator = Estimator::BayesPose;
  /// Source of the design rows of ridge and bayes-pose, if there are touches. True: the touched
  /// points. False: the ball centres alone, as in [Li OMM] and as for all other estimators.
  bool use_touches = true;
  SparseOptions sparse{};
};

struct ResidualFigures {
  double mean_abs_m = 0.0;  ///< mean absolute value of a component
  double rms_m = 0.0;
  double max_abs_m = 0.0;
};

struct Statistics {
  std::size_t positions = 0, balls = 0;  ///< balls: readings over all positions
  std::size_t observations = 0;  ///< components, without those of Ball1, which are 0 by definition
  std::size_t unknowns = 0;
  std::size_t rank = 0;               ///< rank of the design with columns of unit length
  double condition = 0.0;             ///< condition number of that design, within its rank
  double effective_parameters = 0.0;  ///< degrees of freedom of the coefficients; rank for ols
  double degrees_of_freedom = 0.0;    ///< observations minus the degrees of freedom of coefficients
                                      ///< and pose rotations
  double s_m = 0.0;                   ///< noise of a ball centre per coordinate
  double w_rad = 0.0;                 ///< random pose rotation per axis; 0 where not estimated
  double slow_noise_m = 0.0;          ///< slow noise per coordinate, in addition to s_m (noise.hpp)
  double chi2_per_dof = 0.0;          ///< chi-square per degree of freedom of the whitened
                                      ///< residuals / s; 0 without s
  ResidualFigures before, after;
  int iterations = 0;
  /// Largest rms difference of V over the balls between this estimate and an estimate with other
  /// hyper-parameters that the data hardly distinguish (comparable_parameters()); bayes-pose only.
  double comparable_m = 0.0;
};

/// Fit of a rotation reference to the model.
struct ReferenceFit {
  std::size_t points = 0;            ///< number of points used
  std::vector<std::size_t> outside;  ///< numbers, from 1, of points outside the hull: not used
  double chi2 = 0.0;                 ///< chi-square of the residuals after rotation and translation
  double dof = 0.0;
  double widened = 1.0;  ///< the rotation's covariance was multiplied by this because of chi2
};

/// The rotation about Ball1 that touches cannot detect.
struct MeanRotation {
  /// Rotation of the estimated V, which was removed so that V has the direction of the blocks. With
  /// touches the prior alone determines its value; if only ball errors were given, it is the mean
  /// of the estimated pose rotations.
  Vector3 removed_rad = Vector3::Zero();
  Matrix3 cov_rad2 = Matrix3::Zero();  ///< included in the model's covariance
  bool referenced = false;  ///< measured by another instrument; else V is correct in shape only
  std::optional<ReferenceFit> rotation_reference{};  ///< from with_rotation_reference()
};

struct Solution {
  VolumetricModel model;
  Eigen::VectorXd raw_c_m;  ///< coefficients before V(Ball1) = 0 and the rotation were set
  Estimator estimator = Estimator::BayesPose;
  CovarianceKind covariance = CovarianceKind::Analytic;
  std::optional<HyperParameters> hyper;
  std::optional<SparseChoice> sparse;
  /// Observed minus fitted, pose rotations removed, in the order of the observations; zero for
  /// Ball1.
  std::vector<Vector3> residuals_m;
  std::vector<Vector3> pose_rotations_rad;  ///< estimated, by position; empty where not modelled
  MeanRotation rotation;
  std::optional<ArtefactUncertainty> artefact;  ///< copy of Observations::artefact; its effect is
                                                ///< in the covariance
  /// Observations::slow_noise as given or, by bayes-pose from touches, as estimated.
  double slow_noise = 0.0;
  Statistics statistics;
};

/// The scaled design over the readings.
[[nodiscard]] Result<ScaledDesign> design_of(const Observations&);

/// Estimates the model. Errors: those of sparse::grid_search for lasso, mcp and scad (folds that do
/// not match the rows); RankDeficient for ols if the positions do not determine every combination;
/// TooFewObservations; DegenerateGeometry if the balls enclose no volume.
[[nodiscard]] Result<Solution> solve(const Observations&, const SolveOptions& = {});

/// V at some readings, measured by another instrument whose axes are parallel to those of the
/// machine. A constant vector that is common to all readings may be unknown.
struct RotationReference {
  /// Points of the reference; `position` and `ball` are ignored. At least 3 points in the hull, not
  /// on a line.
  std::span<const BallError> points;
  double sigma_m = 1e-6;  ///< standard uncertainty of V, per component, independent
};
/// Returns the solution rotated about Ball1 so that it agrees with the reference, whose V may have
/// another constant. The rotation omega is fitted to r = V_reference - V_model by generalised least
/// squares, omega = K r, with the noise sigma of the reference and the uncertainty of the model's
/// shape at the reference points (B C B^T; B: design at these points, C: covariance of the
/// coefficients c). The covariance of the rotated solution contains both:
///     C' = (1 - G K B) C (1 - G K B)^T + sigma^2 G K K^T G^T,    G: c of a rotation about Ball1.
/// Points outside the hull of the balls (by 2 % of its size) are not used, and their numbers are
/// reported. If chi-square exceeds the value that a correct reference exceeds once in 1000, the
/// rotation's covariance is multiplied by chi-square per degree of freedom; beyond 4 per degree of
/// freedom the result is BadInput, because the reference then has another frame, sign or artefact.
/// The test compares only errors of the machine other than a rigid motion; on a machine without
/// such errors every reference passes.
[[nodiscard]] Result<Solution> with_rotation_reference(Solution, const RotationReference&);

}  // namespace abbe::calib::evemu
