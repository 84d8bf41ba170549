#include <Eigen/Dense>
#include <algorithm>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"
#include "abbe/calib/internal/sparse/convexity.hpp"
#include "abbe/calib/internal/sparse/cross_validation.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::evemu {
namespace {

/// The regression problem of [Li OMM]. Its columns are plain monomials in mm and not those of the
/// scaled design, because the result of a penalised fit depends on the form of the columns.
struct Regression {
  Eigen::MatrixXd X;
  Eigen::VectorXd y;
};

Regression regression_of(const FitProblem& problem) {
  const Observations& o = problem.observations;
  Regression r{{problem.y.size(), static_cast<Eigen::Index>(problem.design.size())},
               kMmPerM * problem.y};
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    r.X.middleRows<3>(static_cast<Eigen::Index>(3 * i)) =
        problem.design.equivalent().X(kMmPerM * o.rows[i].reading_m);
  }
  return r;
}

sparse::PenaltyKind kind_of(Estimator e) {
  return e == Estimator::Lasso
             ? sparse::PenaltyKind::Lasso
             : (e == Estimator::Mcp ? sparse::PenaltyKind::Mcp : sparse::PenaltyKind::Scad);
}

/// 50 values of gamma as in [Li OMM] (its optima are in this list); the lasso does not use gamma.
std::vector<double> gammas(const SolveOptions& options) {
  if (options.estimator == Estimator::Lasso) {
    return {3.0};
  }
  if (!options.sparse.gamma.empty()) {
    return options.sparse.gamma;
  }
  constexpr double kMost = 100.0, kMcpLeast = 1.001, kScadLeast = 2.001;
  return sparse::equally_spaced(options.estimator == Estimator::Mcp ? kMcpLeast : kScadLeast, kMost,
                                50);
}

Result<sparse::Folds> folds_of(const Observations& o, const SparseOptions& options) {
  if (options.given_folds) {
    return *options.given_folds;
  }
  if (options.folds == FoldsBy::Row) {
    constexpr int kFolds = 10;
    return sparse::random_folds(3 * o.rows.size(), kFolds, options.seed);
  }
  std::vector<int> label;
  for (const BallError& row : o.rows) {
    label.insert(label.end(), 3, options.folds == FoldsBy::Position ? row.position : row.ball);
  }
  return sparse::folds_from_labels(label);
}

sparse::PathOptions path_along(std::vector<double> lambda) {
  sparse::PathOptions options;
  options.lambda = std::move(lambda);
  return options;
}

Result<SparseChoice> choose(const Regression& r, const FitProblem& problem,
                            const SolveOptions& options) {
  const Result<sparse::Folds> folds = folds_of(problem.observations, options.sparse);
  ABBE_TRY(folds);

  const auto path = path_along(options.sparse.lambda.empty() ? sparse::log_spaced(1e-1, 1e-10, 100)
                                                             : options.sparse.lambda);
  return sparse::grid_search(r.X, r.y, kind_of(options.estimator), gammas(options), *folds, path)
      .map([](const sparse::GridSearch& g) {
        SparseChoice choice;
        choice.lambda.assign(g.lambda.begin(), g.lambda.begin() + g.best.lambda + 1);
        choice.gamma = g.gamma[static_cast<std::size_t>(g.best.gamma)];
        choice.all_lambda = g.lambda;
        choice.all_gamma = g.gamma;
        choice.error_mm2 = g.error;
        return choice;
      });
}

/// Coefficients of the scaled design [m] from named coefficients, intercept first. The intercept is
/// added to the constants of all three components.
Eigen::VectorXd scaled_from_named(const ScaledDesign& design, Eigen::VectorXd with_intercept) {
  Eigen::VectorXd beta = with_intercept.tail(with_intercept.size() - 1);
  for (std::size_t j = 0; j < design.size(); ++j) {
    if (design.functions()[j].kind == FunctionKind::Constant) {
      beta(static_cast<Eigen::Index>(j)) += with_intercept(0);
    }
  }
  // The rows of M have units from mm to rad mm^-order and very different sizes. They are scaled to
  // unit norm before the system is solved.
  const Eigen::MatrixXd M = design.named_from_scaled();
  const Eigen::VectorXd scale = M.rowwise().norm().cwiseInverse();
  return (scale.asDiagonal() * M).fullPivLu().solve(scale.cwiseProduct(beta)) / kMmPerM;
}

/// The regularisation path down to the chosen lambda. NotConverged if the path ends before: the
/// solution for a larger lambda would be another estimate.
Result<sparse::Path> path_to(const Regression& r, const SolveOptions& asked,
                             const SparseChoice& choice) {
  sparse::PathOptions options = path_along(choice.lambda);
  options.max_sweeps = asked.sparse.max_sweeps;

  return sparse::fit_path(r.X, r.y, {kind_of(asked.estimator), choice.gamma}, options)
      .and_then([&](sparse::Path path) -> Result<sparse::Path> {
        const auto reached = static_cast<std::size_t>(path.reached());
        if (reached == choice.lambda.size() && !path.budget_exhausted) {
          return path;
        }
        return failure(
            ErrorCode::NotConverged,
            message("sparse fit (", name(asked.estimator), ", gamma ", choice.gamma,
                    "): the limit max_sweeps = ", options.max_sweeps, " was reached at lambda ",
                    path.lambda[std::max<std::size_t>(reached, 1) - 1], ", number ", reached,
                    " of ", choice.lambda.size(), "; choose a larger lambda"));
      });
}

Eigen::VectorXd at_end(const sparse::Path& path) {
  return path.coefficients.col(path.reached() - 1);
}

/// Covariance of the coefficients of fits to random data, which are drawn around the fitted values.
Result<Eigen::MatrixXd> bootstrap(const FitProblem& problem, const Regression& r,
                                  const Eigen::VectorXd& fitted_mm, const SolveOptions& options,
                                  const SparseChoice& choice, const HyperParameters& noise) {
  NormalDeviates normal(options.sparse.seed);
  const auto draw = [&](Eigen::Index n) {
    Eigen::VectorXd z(n);
    for (double& value : z) {
      value = normal.next();
    }
    return z;
  };

  const Observations& o = problem.observations;
  const Eigen::MatrixXd S = pose_rotation_rows(o);
  const auto runs = static_cast<Eigen::Index>(options.sparse.bootstrap_runs);
  Eigen::MatrixXd c(static_cast<Eigen::Index>(problem.design.size()), runs);

  for (Eigen::Index run = 0; run < runs; ++run) {
    const Eigen::VectorXd of_rows = draw(r.y.size()),
                          of_poses = draw(S.cols());  // drawn in this order by every compiler
    Eigen::VectorXd scatter = coloured(o, noise.s_m * of_rows) + S * (noise.w_rad * of_poses);
    if (problem.A.cols() > 0) {
      scatter += problem.A * draw(problem.A.cols());  // a run has the same array at all positions
    }
    const auto refit = path_to({r.X, fitted_mm + kMmPerM * scatter}, options, choice);
    ABBE_TRY(refit);
    c.col(run) = scaled_from_named(problem.design, at_end(*refit));
  }

  c.colwise() -= Eigen::VectorXd(c.rowwise().mean());
  return Eigen::MatrixXd(c * c.transpose() /
                         static_cast<double>(std::max<Eigen::Index>(1, runs - 1)));
}

/// Adds the covariance by bootstrap. The sizes of noise and pose rotations are taken from the
/// estimator bayes-pose, because the residuals of a sparse fit are too small.
Result<void> add_covariance(const FitProblem& problem, const Regression& r,
                            const Eigen::VectorXd& beta, const SolveOptions& options, Fit& fit) {
  SolveOptions bayes;
  bayes.use_touches = false;
  const Result<Fit> noise =
      fit_prior(PriorKind::BayesPose, problem_of(problem.observations, problem.design, bayes));

  ABBE_TRY(noise);

  const Eigen::VectorXd fitted_mm = (r.X * beta.tail(beta.size() - 1)).array() + beta(0);
  Result<Eigen::MatrixXd> covariance =
      bootstrap(problem, r, fitted_mm, options, *fit.sparse, *noise->hyper);

  ABBE_TRY(covariance);

  fit.covariance_m2 = *std::move(covariance);
  fit.s_m = noise->s_m;
  fit.w_rad = noise->w_rad;

  return {};
}

}  // namespace

Result<Fit> fit_sparse(const FitProblem& problem, const SolveOptions& options) {
  const Regression r = regression_of(problem);
  Result<SparseChoice> choice = options.sparse.chosen ? Result<SparseChoice>(*options.sparse.chosen)
                                                      : choose(r, problem, options);

  ABBE_TRY(choice);

  const Result<sparse::Path> path = path_to(r, options, *choice);
  ABBE_TRY(path);

  const Result<sparse::Convexity> convexity = sparse::convexity(r.X, *path);
  ABBE_TRY(convexity);

  choice->curvature = convexity->smallest_eigenvalue(path->reached() - 1);
  const Eigen::VectorXd beta = at_end(*path);
  const auto n = static_cast<Eigen::Index>(problem.design.size());
  Fit fit;
  fit.kind = CovarianceKind::Bootstrap;
  fit.c_m = scaled_from_named(problem.design, beta);
  fit.effective_parameters = static_cast<double>((beta.tail(n).array() != 0.0).count());
  fit.covariance_m2 = Eigen::MatrixXd::Zero(n, n);
  fit.sparse = *std::move(choice);
  fit.iterations = static_cast<int>(path->reached());

  if (options.sparse.bootstrap_runs > 1) {
    ABBE_TRY(add_covariance(problem, r, beta, options, fit));
  }

  return fit;
}

}  // namespace abbe::calib::evemu
