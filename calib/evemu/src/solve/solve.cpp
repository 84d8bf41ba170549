#include "abbe/calib/evemu/solve/solve.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/estimation/dense_information.hpp"
#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/calib/internal/evemu/solve/design_rows.hpp"
#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"
#include "abbe/calib/internal/geometry/constant_fields.hpp"
#include "abbe/result/try.hpp"
#include "solve/find_misfit.hpp"
#include "solve/slow_noise.hpp"

namespace abbe::calib::evemu {
namespace {

constexpr std::array<std::pair<Estimator, std::string_view>, 6> kEstimatorNames{
    {{Estimator::Ols, "ols"},
     {Estimator::Ridge, "ridge"},
     {Estimator::BayesPose, "bayes-pose"},
     {Estimator::Lasso, "lasso"},
     {Estimator::Mcp, "mcp"},
     {Estimator::Scad, "scad"}}};

std::vector<Vector3> readings_m(const Observations& o) {
  std::vector<Vector3> readings;
  for (const BallError& row : o.rows) {
    readings.push_back(row.reading_m);
  }
  return readings;
}

/// block_rotation() (Theta of observe.hpp) averaged over the positions, 3 x design.unknowns.
Eigen::Matrix3Xd mean_block_rotation(const Observations& o, const VolumetricDesign& design) {
  Eigen::Matrix3Xd mean = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(design.unknowns));
  for (const TouchedArtefact& seen : o.seen) {
    mean += block_rotation(seen, design) / static_cast<double>(o.seen.size());
  }
  return mean;
}

/// Prior covariance of the rotation by which squareness errors and slopes of the machine's errors
/// rotate the measured blocks: kLinearPrior_m over the largest half width, as an angle.
Matrix3 prior_rotation_rad2(const ScaledDesign& design) {
  const double u_rad = kLinearPrior_m / design.arm_unit_m();
  return u_rad * u_rad * Matrix3::Identity();
}

/// Matrix of the S-transformation (estimation/datum.hpp) of the coefficients to the datum
///     V(Ball1) = 0, and with touches: mean rotation of the blocks = 0
/// `mean`: mean_block_rotation(), used with touches only.
Result<Eigen::MatrixXd> to_datum(const FitProblem& problem, const Eigen::Matrix3Xd& mean) {
  const ScaledDesign& design = problem.design;
  const Vector3& ball1_m = problem.observations.ball1_m;
  if (!problem.from_touches) {
    return estimation::Datum(design.B(ball1_m)).transformation(constant_fields(design));
  }

  Eigen::MatrixXd conditions(6, mean.cols()), free(mean.cols(), 6);
  conditions << design.B(ball1_m), mean;
  free << constant_fields(design), design.rotation_about(ball1_m);
  return estimation::Datum(conditions).transformation(free);
}

/// Transforms the fit to_datum() and adds the uncertainty of the rotation to the covariance.
Result<MeanRotation> set_datum(const FitProblem& problem, Fit& fit) {
  const Observations& o = problem.observations;
  const Eigen::MatrixX3d G = problem.design.rotation_about(o.ball1_m);
  MeanRotation rotation;
  rotation.referenced = o.rotation == RotationOrigin::Independent;
  Eigen::Matrix3Xd mean;

  if (problem.from_touches) {
    mean = mean_block_rotation(o, problem.design);
    rotation.removed_rad = mean * fit.c_m;
    rotation.cov_rad2 = mean * fit.covariance_m2 * mean.transpose();
  } else {
    for (const Vector3& theta : fit.pose_rotations_rad) {
      rotation.removed_rad += theta / static_cast<double>(fit.pose_rotations_rad.size());
    }
    rotation.cov_rad2 =
        rotation.referenced ? fit.cov_mean_pose_rotation_rad2 : prior_rotation_rad2(problem.design);
  }

  const Result<Eigen::MatrixXd> S = to_datum(problem, mean);
  ABBE_TRY(S);

  fit.c_m = *S * fit.c_m;
  fit.covariance_m2 = *S * fit.covariance_m2 * S->transpose();
  if (fit.artefact_m.cols() > 0) {
    const Eigen::MatrixXd off_m = *S * fit.artefact_m;
    fit.covariance_m2 += off_m * off_m.transpose();
  }

  if (!rotation.referenced) {
    fit.covariance_m2 += G * rotation.cov_rad2 * G.transpose();
  }

  fit.covariance_m2 = 0.5 * (fit.covariance_m2 + fit.covariance_m2.transpose()).eval();
  return rotation;
}

ResidualFigures residual_figures(const Observations& o, const Eigen::VectorXd& r) {
  ResidualFigures f;
  double squares = 0.0, sum = 0.0;
  std::size_t count = 0;

  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (o.rows[i].ball == 1) {
      continue;
    }
    const Vector3 at = r.segment<3>(static_cast<Eigen::Index>(3 * i));
    squares += at.squaredNorm();
    sum += at.lpNorm<1>();
    f.max_abs_m = std::max(f.max_abs_m, at.lpNorm<Eigen::Infinity>());
    count += 3;
  }

  f.mean_abs_m = sum / static_cast<double>(std::max<std::size_t>(1, count));
  f.rms_m = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, count)));
  return f;
}

/// Observed minus fitted, without the estimated pose rotations; zero for Ball1, which is not an
/// observation.
Eigen::VectorXd residuals_of(const FitProblem& problem, const Fit& fit) {
  const Observations& o = problem.observations;
  Eigen::VectorXd r = problem.y - problem.X * fit.c_m;
  if (!fit.pose_rotations_rad.empty()) {
    Eigen::VectorXd omega(static_cast<Eigen::Index>(3 * fit.pose_rotations_rad.size()));
    for (std::size_t p = 0; p < fit.pose_rotations_rad.size(); ++p) {
      omega.segment<3>(static_cast<Eigen::Index>(3 * p)) = fit.pose_rotations_rad[p];
    }
    r -= pose_rotation_rows(o) * omega;
  }

  for (const PositionRows& p : position_rows(o)) {
    r.segment<3>(static_cast<Eigen::Index>(3 * p.ball1)).setZero();
  }

  return r;
}

Statistics statistics_of(const FitProblem& problem, const Fit& fit, const Eigen::VectorXd& r) {
  const Observations& o = problem.observations;
  Statistics s;
  s.positions = o.positions();
  s.balls = o.rows.size();
  s.observations = 3 * (o.rows.size() - s.positions);
  s.unknowns = problem.design.size();
  const estimation::Spectrum design =
      estimation::spectrum(estimation::information_of(problem.X, problem.y), kUndetermined);
  s.rank = design.rank;
  s.condition = design.condition;
  s.effective_parameters = fit.effective_parameters;
  s.degrees_of_freedom =
      static_cast<double>(s.observations) - fit.effective_parameters - fit.pose_parameters;
  s.s_m = fit.s_m;
  s.w_rad = fit.w_rad;
  s.slow_noise_m = o.slow_noise * fit.s_m;
  s.before = residual_figures(o, problem.y);
  s.after = residual_figures(o, r);

  if (fit.s_m > 0.0) {
    s.chi2_per_dof =
        whitened(o, r).squaredNorm() / (fit.s_m * fit.s_m) / std::max(1.0, s.degrees_of_freedom);
  }

  s.iterations = fit.iterations;
  return s;
}

/// BadInput for a sparse estimator without bootstrap: its noise and covariance come only from the
/// bootstrap.
Result<void> check(const SolveOptions& options) {
  const bool is_sparse = options.estimator == Estimator::Lasso ||
                         options.estimator == Estimator::Mcp ||
                         options.estimator == Estimator::Scad;
  constexpr int kLeastRuns = 2;
  if (is_sparse && options.sparse.bootstrap_runs < kLeastRuns) {
    return failure(ErrorCode::BadInput,
                   message("ball array: bootstrap_runs = ", options.sparse.bootstrap_runs,
                           " gives no uncertainty, needs at least ", kLeastRuns));
  }
  return {};
}

std::vector<Vector3> by_ball(const Eigen::VectorXd& r) {
  std::vector<Vector3> balls;
  for (Eigen::Index i = 0; i + 2 < r.size(); i += 3) {
    balls.emplace_back(r.segment<3>(i));
  }
  return balls;
}

}  // namespace

std::string_view name(Estimator e) {
  return kEstimatorNames[static_cast<std::size_t>(e)].second;
}

std::optional<Estimator> estimator(std::string_view text) {
  for (const auto& [value, known] : kEstimatorNames) {
    if (known == text) {
      return value;
    }
  }
  return std::nullopt;
}

std::string_view name(FoldsBy folds) {
  return folds == FoldsBy::Position ? "position" : (folds == FoldsBy::Ball ? "ball" : "row");
}

std::optional<FoldsBy> folds_by(std::string_view text) {
  for (const FoldsBy folds : {FoldsBy::Position, FoldsBy::Ball, FoldsBy::Row}) {
    if (name(folds) == text) {
      return folds;
    }
  }
  return std::nullopt;
}

std::string_view name(CovarianceKind kind) {
  return kind == CovarianceKind::Analytic ? "analytic" : "bootstrap by position";
}

Result<ScaledDesign> design_of(const Observations& o) {
  return ScaledDesign::of(o.machine.chain, o.order, bounding_box(readings_m(o)));
}

Result<Solution> solve(const Observations& o, const SolveOptions& options) {
  ABBE_TRY(check(options));

  constexpr std::size_t kLeastPositions = 2;
  if (o.positions() < kLeastPositions) {
    return failure(ErrorCode::TooFewObservations,
                   message("ball array: ", o.positions(), " positions, needs ", kLeastPositions));
  }

  Result<ScaledDesign> design = design_of(o);
  ABBE_TRY(design);

  const FitProblem problem = problem_of(o, *design, options);
  Result<Fit> fit = fit_with(problem, options);
  ABBE_TRY(fit);

  if (options.estimator == Estimator::BayesPose && problem.from_touches && o.slow_noise == 0.0) {
    const Result<SlowNoise> slow = likely_slow_noise(o, *design, *fit->hyper);
    ABBE_TRY(slow);
    if (slow->log_likelihood > kLeastSlowNoiseGain) {
      return solve(with_slow_noise(o, slow->per_s), options);
    }
  }

  const Eigen::VectorXd residuals = residuals_of(problem, *fit);
  Statistics statistics = statistics_of(problem, *fit, residuals);
  if (options.estimator == Estimator::BayesPose) {
    statistics.comparable_m = cover_comparable(*fit, problem);
  }

  const Eigen::VectorXd raw_c_m = fit->c_m;
  const Result<MeanRotation> rotation = set_datum(problem, *fit);
  ABBE_TRY(rotation);

  Result<ValidityVolume> validity = ValidityVolume::hull_of(readings_m(o));

  ABBE_TRY(validity);

  Result<PolynomialModel> evemu =
      PolynomialModel::of(*design, o.ball1_m, fit->c_m, fit->covariance_m2);
  ABBE_TRY(evemu);

  return VolumetricModel::from_polynomials(
             *std::move(evemu), rotation->referenced ? ModelDatum::Ball1 : ModelDatum::Ball1Blocks,
             o.machine.tool_offset_m, *std::move(validity))
      .and_then([&](VolumetricModel model) {
        const std::optional<Misfit> misfit = find_misfit(o, model, statistics);
        return misfit ? model.with_misfit(*misfit) : Result<VolumetricModel>(std::move(model));
      })
      .map([&](VolumetricModel model) {
        return Solution{.model = std::move(model),
                        .raw_c_m = raw_c_m,
                        .estimator = options.estimator,
                        .covariance = fit->kind,
                        .hyper = fit->hyper,
                        .sparse = fit->sparse,
                        .residuals_m = by_ball(residuals),
                        .pose_rotations_rad = fit->pose_rotations_rad,
                        .rotation = *rotation,
                        .artefact = o.artefact,
                        .slow_noise = o.slow_noise,
                        .statistics = statistics};
      });
}

}  // namespace abbe::calib::evemu
