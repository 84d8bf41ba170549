#include "held_out.hpp"

#include <numeric>

#include "abbe/calib/internal/base/message.hpp"
#include "lane_batch.hpp"

namespace abbe::calib::sparse {
namespace {

using Rows = std::vector<Eigen::Index>;

MeanError mean_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return {static_cast<double>(values.size()), values.mean()};
}

/// X with the columns that `design` keeps, shifted and scaled with the means and scales of
/// `design`.
Eigen::MatrixXd like(const Standardised& design, const Eigen::MatrixXd& X) {
  return (X(Eigen::all, design.kept).rowwise() - design.mean.transpose()) *
         design.scale.cwiseInverse().asDiagonal();
}

std::vector<MeanError> errors_of(const Eigen::MatrixXd& X, const Eigen::VectorXd& y,
                                 const Eigen::MatrixXd& b) {
  const Eigen::MatrixXd squared = ((X * b).colwise() - y).array().square();
  std::vector<MeanError> errors;
  for (Eigen::Index k = 0; k < b.cols(); ++k) {
    errors.push_back(mean_of(squared.col(k)));
  }
  return errors;
}

}  // namespace

void MeanError::add(const MeanError& more) {
  const double total = count + more.count;
  mean += (more.mean - mean) * more.count / total;
  count = total;
}

Result<HeldOut> hold_out(const GramProblem& all, const Folds& folds, int fold,
                         const std::vector<Penalty>& penalties, const LambdaList& lambda,
                         const PathOptions& options) {
  Rows train, test;
  for (std::size_t i = 0; i < folds.of_row.size(); ++i) {
    (folds.of_row[i] == fold ? test : train).push_back(static_cast<Eigen::Index>(i));
  }

  const auto problem = gram_problem(all.design.X(train, Eigen::all), all.y(train));
  if (!problem) {
    return failure(problem.error().code,
                   message("without fold ", fold, ": ", problem.error().text));
  }

  std::vector<PathTask> tasks;
  tasks.reserve(penalties.size());
  for (const Penalty& penalty : penalties) {
    tasks.push_back(path_task(*problem, penalty, lambda, options));
  }

  const Eigen::MatrixXd X_test = like(problem->design, all.design.X(test, Eigen::all));
  const Eigen::VectorXd y_test = all.y(test).array() - problem->y_mean;
  HeldOut out;

  for (const SolvedPath& path : solve_paths(*problem, tasks)) {
    out.error.push_back(errors_of(X_test, y_test, path.b));
    out.sweeps = std::accumulate(path.sweeps.begin(), path.sweeps.end(), out.sweeps);
  }

  return out;
}

}  // namespace abbe::calib::sparse
