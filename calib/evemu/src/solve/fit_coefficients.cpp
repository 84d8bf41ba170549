#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"

#include <Eigen/Dense>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/estimation/considered.hpp"
#include "abbe/calib/internal/estimation/dense_information.hpp"
#include "abbe/calib/internal/evemu/solve/artefact_rows.hpp"
#include "abbe/calib/internal/evemu/solve/design_rows.hpp"
#include "abbe/result/try.hpp"
#include "solve/norm_over_balls.hpp"

namespace abbe::calib::evemu {
namespace {

/// Removes the rows of Ball1, whose error is zero by definition: an estimator would take these rows
/// for observations without noise.
Eigen::MatrixXd without_ball1(const Observations& o, const Eigen::MatrixXd& rows) {
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (o.rows[i].ball != 1) {
      for (std::size_t c = 0; c < 3; ++c) {
        kept.push_back(static_cast<Eigen::Index>(3 * i + c));
      }
    }
  }
  return rows(kept, Eigen::all);
}

/// Whitened rows of coefficients and pose rotations.
LinearGaussian gaussian_of(const FitProblem& problem) {
  const Observations& o = problem.observations;
  return {white_rows(o, problem.X), white_rows(o, pose_rotation_rows(o)), white_rows(o, problem.y)};
}

/// As gaussian_of(), with the columns of the errors of the array.
LinearGaussian gaussian_with_array(const FitProblem& problem) {
  const Observations& o = problem.observations;
  return {white_rows(o, problem.X), white_rows(o, pose_rotation_rows(o)), white_rows(o, problem.A),
          white_rows(o, problem.y)};
}

/// Trace of the covariance of the residuals of least squares with equal weights, in units of s^2:
/// their expected sum of squares. The residuals are (1 - Q Q^T) noise, X = Q R, so it is
///     trace C0 - trace Q^T C0 Q = trace C0 - |R_n R^-1|^2,    X^T C0 X = R_n^T R_n
/// 0 if the difference is not above rounding.
double trace_of_residuals(const Observations& o, const estimation::Information& data,
                          const estimation::Information& noise) {
  double trace_C0 = 0.0;
  for (const PositionRows& p : position_rows(o)) {
    trace_C0 += 3.0 * ball_covariance(o, p).trace();
  }

  constexpr double kRounding = 1e-10;
  const Eigen::MatrixXd R = data.R();
  const double left =
      trace_C0 - R.triangularView<Eigen::Upper>().solve<Eigen::OnTheRight>(noise.R()).squaredNorm();
  return left > kRounding * trace_C0 ? left : 0.0;
}

}  // namespace

Eigen::MatrixXd white_rows(const Observations& o, const Eigen::MatrixXd& rows) {
  return without_ball1(o, whitened(o, rows));
}

Result<Fit> fit_ols(const FitProblem& problem) {
  const Observations& o = problem.observations;
  const std::size_t n = problem.design.size();
  const estimation::Information data = estimation::information_of(problem.X, problem.y);

  // All rows have the same weight, although their noise has the covariance s^2 C0 (noise.hpp).
  const estimation::Information noise = estimation::information_of(
      times_noise_root(o, problem.X), Eigen::VectorXd::Zero(problem.y.size()));
  const estimation::Datum without_conditions(Eigen::MatrixXd(0, problem.X.cols()));
  const Result<estimation::DatumSolution> adjusted = without_conditions.solve(
      data, {.noise = &noise, .zero = kUndetermined, .label = [&](std::size_t j) {
               return problem.design.equivalent().names()[j];
             }});

  if (!adjusted) {
    return failure(adjusted.error().code, "least squares: " + adjusted.error().text);
  }

  const double left = trace_of_residuals(o, data, noise);
  if (!(left > 0.0)) {
    return failure(ErrorCode::TooFewObservations,
                   message("least squares: ", problem.X.rows(), " components for ", n,
                           " coefficients are too few to estimate the noise"));
  }

  const double s2 = data.rest() / left;
  Fit fit;
  fit.c_m = adjusted->U;
  fit.covariance_m2 = s2 * adjusted->covariance;

  if (problem.A.cols() > 0) {
    Eigen::MatrixXd with_array(problem.X.rows(), problem.X.cols() + problem.A.cols());
    with_array << problem.X, problem.A;
    fit.artefact_m = estimation::sensitivity(estimation::information_of(with_array, problem.y), n);
  }

  fit.s_m = std::sqrt(s2);
  fit.effective_parameters = static_cast<double>(n);
  fit.iterations = 1;

  return fit;
}

Result<Fit> fit_prior(PriorKind kind, const FitProblem& problem) {
  const Observations& o = problem.observations;
  const std::size_t positions = o.positions();
  const LinearGaussian gaussian = gaussian_of(problem);
  const Result<HyperParameters> hyper = most_likely(kind, problem.design, positions, gaussian);

  ABBE_TRY(hyper);

  Fit fit;
  fit.hyper = *hyper;
  const HyperParameters& h = *fit.hyper;
  const Eigen::VectorXd prior = prior_variances(kind, problem.design, positions, h);
  const LinearGaussian::Posterior p = gaussian.posterior(prior, h.s_m * h.s_m);

  if (!p.mean.allFinite() || !p.covariance.allFinite()) {
    return failure(ErrorCode::NotConverged,
                   message("bayes: no solution at s = ", h.s_m, " m, w = ", h.w_rad, " rad"));
  }

  const auto n = static_cast<Eigen::Index>(problem.design.size());
  fit.c_m = p.mean.head(n);
  fit.covariance_m2 = p.covariance.topLeftCorner(n, n);

  if (problem.A.cols() > 0) {
    fit.artefact_m = gaussian_with_array(problem).response(prior, h.s_m * h.s_m).topRows(n);
  }

  fit.s_m = h.s_m;
  fit.w_rad = h.w_rad;
  fit.effective_parameters = p.effective_parameters;
  fit.pose_parameters = p.effective_pose_parameters;
  fit.iterations = h.evaluations;

  if (kind == PriorKind::BayesPose) {
    Eigen::MatrixXd mean_of = Eigen::MatrixXd::Zero(3, p.mean.size());
    for (std::size_t i = 0; i < positions; ++i) {
      const auto at = n + static_cast<Eigen::Index>(3 * i);
      fit.pose_rotations_rad.emplace_back(p.mean.segment<3>(at));
      mean_of.middleCols<3>(at) = Matrix3::Identity() / static_cast<double>(positions);
    }
    fit.cov_mean_pose_rotation_rad2 = mean_of * p.covariance * mean_of.transpose();
  }

  return fit;
}

double cover_comparable(Fit& fit, const FitProblem& problem) {
  const Observations& o = problem.observations;
  const std::size_t positions = o.positions();
  const LinearGaussian gaussian = gaussian_of(problem);
  const RigidFreeNorm norm = norm_over_balls(o, problem.design);
  Eigen::VectorXd farthest_m = Eigen::VectorXd::Zero(fit.c_m.size());

  for (const HyperParameters& h :
       comparable_parameters(*fit.hyper, problem.design, positions, gaussian)) {
    const Eigen::VectorXd prior =
        prior_variances(PriorKind::BayesPose, problem.design, positions, h);
    const Eigen::VectorXd difference_m =
        gaussian.posterior(prior, h.s_m * h.s_m).mean.head(fit.c_m.size()) - fit.c_m;
    if (norm.rms_m(difference_m) > norm.rms_m(farthest_m)) {
      farthest_m = difference_m;
    }
  }

  const double d_m = norm.rms_m(farthest_m), u_m = norm.rms_u_m(fit.covariance_m2);
  if (d_m > u_m) {
    fit.covariance_m2 += (1.0 - u_m * u_m / (d_m * d_m)) * farthest_m * farthest_m.transpose();
  }

  return d_m;
}

FitProblem problem_of(const Observations& o, const ScaledDesign& design,
                      const SolveOptions& options) {
  // Design rows from touches do not determine a rotation of V about Ball1 and cannot be solved
  // without a prior. Estimators without a prior use the rows of [Li OMM].
  if (options.estimator != Estimator::BayesPose && options.estimator != Estimator::Ridge) {
    return {o,     design,          design_rows(o, design, RowsFrom::Centres), observed_m(o),
            false, artefact_rows(o)};
  }

  const bool from_touches = options.use_touches && !o.seen.empty();
  return {o,
          design,
          relative_rows(o, design, from_touches ? RowsFrom::Touches : RowsFrom::Centres),
          observed_m(o),
          from_touches,
          artefact_rows(o)};
}

Result<Fit> fit_with(const FitProblem& problem, const SolveOptions& options) {
  switch (options.estimator) {
    case Estimator::Ols:
      return fit_ols(problem);
    case Estimator::Ridge:
      return fit_prior(PriorKind::Ridge, problem);
    case Estimator::BayesPose:
      return fit_prior(PriorKind::BayesPose, problem);
    case Estimator::Lasso:
    case Estimator::Mcp:
    case Estimator::Scad:
      return fit_sparse(problem, options);
  }

  return failure(ErrorCode::BadInput, message("unknown estimator ", name(options.estimator)));
}

}  // namespace abbe::calib::evemu
