#include "abbe/calib/internal/sparse/cross_validation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"
#include "held_out.hpp"
#include "lane_batch.hpp"
#include "path_setup.hpp"

namespace abbe::calib::sparse {
namespace {

Result<void> check(const Folds& folds, Eigen::Index rows) {
  if (static_cast<Eigen::Index>(folds.of_row.size()) != rows || folds.count < 2) {
    return failure(ErrorCode::BadInput,
                   message("cross-validation: ", folds.count, " folds of ", folds.of_row.size(),
                           " rows; needs at least 2 folds of ", rows, " rows"));
  }

  std::vector<int> size(static_cast<std::size_t>(folds.count), 0);
  for (const int fold : folds.of_row) {
    if (fold < 0 || fold >= folds.count) {
      return failure(ErrorCode::BadInput,
                     message("cross-validation: fold ", fold, " of ", folds.count));
    }
    ++size[static_cast<std::size_t>(fold)];
  }

  const auto empty = std::find(size.begin(), size.end(), 0);
  if (empty != size.end()) {
    return failure(ErrorCode::BadInput,
                   message("cross-validation: fold ", empty - size.begin(), " has no row"));
  }

  return {};
}

Result<std::vector<Penalty>> penalties(PenaltyKind kind, const std::vector<double>& gamma) {
  std::vector<Penalty> out;
  for (const double g : gamma) {
    out.push_back({kind, g});
    ABBE_TRY(check(out.back()));
  }
  if (out.empty()) return failure(ErrorCode::BadInput, "grid search: no gamma");
  return out;
}

std::vector<Path> full_paths(const GramProblem& problem, const std::vector<Penalty>& penalties,
                             const LambdaList& lambda, const PathOptions& options) {
  std::vector<PathTask> tasks;
  tasks.reserve(penalties.size());
  for (const Penalty& penalty : penalties) {
    tasks.push_back(path_task(problem, penalty, lambda, options));
  }
  std::vector<SolvedPath> solved = solve_paths(problem, tasks);
  std::vector<Path> paths;
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    paths.push_back(to_path(problem, tasks[i], std::move(solved[i])));
  }
  return paths;
}

/// Number of lambdas that the full path and every fold reached at this gamma.
std::size_t common_reach(const Path& path, const std::vector<HeldOut>& folds, std::size_t gamma) {
  std::size_t reach = path.sweeps.size();
  for (const HeldOut& fold : folds) {
    reach = std::min(reach, fold.error[gamma].size());
  }
  return reach;
}

void fill_surface(GridSearch& grid, const std::vector<HeldOut>& folds) {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  const auto rows = static_cast<Eigen::Index>(grid.lambda.size()),
             columns = static_cast<Eigen::Index>(grid.gamma.size());
  grid.error = Eigen::MatrixXd::Constant(rows, columns, kMissing);

  for (std::size_t g = 0; g < grid.gamma.size(); ++g) {
    const std::size_t reach = common_reach(grid.paths[g], folds, g);
    for (std::size_t l = 0; l < reach; ++l) {
      MeanError cell;
      for (const HeldOut& fold : folds) {
        cell.add(fold.error[g][l]);
      }
      grid.error(static_cast<Eigen::Index>(l), static_cast<Eigen::Index>(g)) = cell.mean;
    }
  }
}

bool choose_best(GridSearch& grid) {
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index g = 0; g < grid.error.cols(); ++g) {
    for (Eigen::Index l = 0; l < grid.error.rows(); ++l) {
      if (grid.error(l, g) < least) {
        least = grid.error(l, g);
        grid.best = {l, g};
      }
    }
  }
  return std::isfinite(least);
}

long count_sweeps(const std::vector<Path>& paths, const std::vector<HeldOut>& folds) {
  long sweeps = 0;
  for (const Path& path : paths) {
    sweeps = std::accumulate(path.sweeps.begin(), path.sweeps.end(), sweeps);
  }
  for (const HeldOut& fold : folds) {
    sweeps += fold.sweeps;
  }
  return sweeps;
}

Result<GridSearch> search(const GramProblem& problem, const std::vector<Penalty>& penalties,
                          const Folds& folds, const PathOptions& options,
                          const ParallelFor& parallel_for) {
  const LambdaList lambda = lambda_list(problem, options);
  const LambdaList given{lambda.values, false};
  GridSearch grid;
  std::vector<Result<HeldOut>> held_out(static_cast<std::size_t>(folds.count));

  parallel_for(held_out.size() + 1, [&](std::size_t i) {
    if (i == held_out.size()) {
      grid.paths = full_paths(problem, penalties, lambda, options);
    } else {
      held_out[i] = hold_out(problem, folds, static_cast<int>(i), penalties, given, options);
    }
  });

  std::vector<HeldOut> judged;
  for (Result<HeldOut>& fold : held_out) {
    ABBE_TRY(fold);
    judged.push_back(std::move(*fold));
  }

  for (const Penalty& penalty : penalties) {
    grid.gamma.push_back(penalty.gamma);
  }

  grid.lambda = lambda.values;
  grid.sweeps = count_sweeps(grid.paths, judged);
  fill_surface(grid, judged);

  if (!choose_best(grid)) {
    return failure(ErrorCode::NotConverged,
                   message("cross-validation: no lambda was reached by every fold within ",
                           options.max_sweeps, " sweeps"));
  }

  return grid;
}

}  // namespace

void serial_for(std::size_t count, const std::function<void(std::size_t)>& task) {
  for (std::size_t i = 0; i < count; ++i) {
    task(i);
  }
}

Result<GridSearch> grid_search(const Eigen::MatrixXd& X, const Eigen::VectorXd& y, PenaltyKind kind,
                               const std::vector<double>& gamma, const Folds& folds,
                               const PathOptions& options, const ParallelFor& parallel_for) {
  const auto wanted = penalties(kind, gamma);
  ABBE_TRY(wanted);
  ABBE_TRY(check(options));
  ABBE_TRY(check(folds, X.rows()));
  return gram_problem(X, y).and_then([&](const GramProblem& problem) {
    return search(problem, *wanted, folds, options, parallel_for);
  });
}

std::vector<double> equally_spaced(double first, double last, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) {
    const double part = count > 1 ? static_cast<double>(i) / (count - 1) : 0.0;
    values.push_back(first + part * (last - first));
  }
  return values;
}

std::vector<double> log_spaced(double first, double last, int count) {
  std::vector<double> values =
      equally_spaced(natural_logarithm(first), natural_logarithm(last), count);
  for (double& v : values) {
    v = exponential(v);
  }
  return values;
}

}  // namespace abbe::calib::sparse
