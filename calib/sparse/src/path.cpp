#include "abbe/calib/internal/sparse/path.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/sparse/cross_validation.hpp"
#include "abbe/result/try.hpp"
#include "lane_batch.hpp"
#include "path_setup.hpp"

namespace abbe::calib::sparse {
namespace {

/// Default ratio of the smallest lambda to lambda_max. For n > p (n rows, p columns) the solution
/// at a thousandth of lambda_max is close to least squares; for n <= p solutions at small lambda,
/// with many nonzero coefficients, are not meaningful.
double default_ratio(const GramProblem& problem) {
  return problem.y.size() > problem.columns() ? 0.001 : 0.05;
}

Result<void> check_lambda(const std::vector<double>& lambda) {
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    if (!std::isfinite(lambda[i]))
      return failure(ErrorCode::NotFinite, message("lambda ", i, " is ", lambda[i]));
    if (lambda[i] < 0)
      return failure(ErrorCode::BadInput, message("lambda ", i, " is negative: ", lambda[i]));
    if (i > 0 && lambda[i] > lambda[i - 1]) {
      return failure(ErrorCode::BadInput,
                     message("lambda must not increase: ", lambda[i], " follows ", lambda[i - 1]));
    }
  }
  return {};
}

}  // namespace

Result<void> check(const PathOptions& options) {
  if (!(options.tolerance > 0) || !std::isfinite(options.tolerance)) {
    return failure(ErrorCode::BadInput,
                   message("tolerance of the path must be positive: ", options.tolerance));
  }

  if (options.max_sweeps < 1) {
    return failure(ErrorCode::BadInput,
                   message("max_sweeps of the path must be at least 1: ", options.max_sweeps));
  }

  if (options.max_nonzero && *options.max_nonzero < 0) {
    return failure(ErrorCode::BadInput,
                   message("max_nonzero of the path is negative: ", *options.max_nonzero));
  }

  return check_lambda(options.lambda);
}

LambdaList lambda_list(const GramProblem& problem, const PathOptions& options) {
  if (!options.lambda.empty()) return {options.lambda, false};
  constexpr int kCount = 100;
  const double largest = problem.lambda_max();
  std::vector<double> lambda = log_spaced(largest, default_ratio(problem) * largest, kCount);
  // log_spaced() computes exp(log(largest)), which may be smaller than `largest` by rounding; the
  // first solution would then not be empty.
  lambda.front() = largest;
  return {std::move(lambda), true};
}

PathTask path_task(const GramProblem& problem, const Penalty& penalty, const LambdaList& lambda,
                   const PathOptions& options) {
  PathTask task;
  task.penalty = penalty;
  task.lambda = lambda.values;
  task.first_is_empty = lambda.first_is_empty;
  task.tolerance = options.tolerance * problem.y_rms;
  task.max_sweeps = options.max_sweeps;
  task.max_nonzero = options.max_nonzero.value_or(problem.columns());
  return task;
}

Path to_path(const GramProblem& problem, const PathTask& task, SolvedPath solved) {
  const Standardised& design = problem.design;
  Path path;
  path.penalty = task.penalty;
  path.lambda.assign(task.lambda.begin(), task.lambda.end());
  path.sweeps = std::move(solved.sweeps);
  path.budget_exhausted = solved.budget_exhausted;
  path.standardised = Eigen::MatrixXd::Zero(design.original_columns, solved.b.cols());
  path.standardised(design.kept, Eigen::all) = solved.b;
  path.coefficients = to_original(design, solved.b, problem.y_mean);
  path.residual_sum_squares =
      ((-design.X * solved.b).colwise() + problem.y).colwise().squaredNorm();

  for (Eigen::Index j = 0; j < design.original_columns; ++j) {
    if (!std::binary_search(design.kept.begin(), design.kept.end(), j)) path.dropped.push_back(j);
  }

  return path;
}

Result<Path> fit_path(const Eigen::MatrixXd& X, const Eigen::VectorXd& y, const Penalty& penalty,
                      const PathOptions& options) {
  ABBE_TRY(check(penalty));
  ABBE_TRY(check(options));
  return gram_problem(X, y).map([&](const GramProblem& problem) {
    const LambdaList lambda = lambda_list(problem, options);
    const std::array task{path_task(problem, penalty, lambda, options)};
    return to_path(problem, task[0], std::move(solve_paths(problem, task)[0]));
  });
}

}  // namespace abbe::calib::sparse
