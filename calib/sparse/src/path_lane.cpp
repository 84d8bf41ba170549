#include "path_lane.hpp"

#include <cmath>
#include <utility>

namespace abbe::calib::sparse {

PathLane::PathLane(const GramProblem& problem, const PathTask& task)
    : problem_(&problem),
      task_(task),
      b_(Eigen::VectorXd::Zero(problem.columns())),
      z_(problem.xty),
      is_active_(static_cast<std::size_t>(problem.columns()), 0),
      is_strong_(static_cast<std::size_t>(problem.columns()), 0) {
  solved_.b.resize(problem.columns(), static_cast<Eigen::Index>(task.lambda.size()));
  if (task.first_is_empty) {
    solved_.sweeps.push_back(0);
    finish_lambda();
  } else {
    begin_lambda();
  }
}

/// Threshold of the strong rule of [Tibshirani 2012]; for MCP and SCAD scaled by the steepest slope
/// of the shrinkage [Breheny 2011].
double PathLane::cutoff() const {
  const double now = task_.lambda[at_];
  const double before = at_ == 0 ? z_.cwiseAbs().maxCoeff() : task_.lambda[at_ - 1];
  const double gamma = task_.penalty.gamma;
  switch (task_.penalty.kind) {
    case PenaltyKind::Mcp:
      return now + gamma / (gamma - 1) * (now - before);
    case PenaltyKind::Scad:
      return now + gamma / (gamma - 2) * (now - before);
    case PenaltyKind::Lasso:
      break;
  }
  return now + (now - before);
}

void PathLane::begin_lambda() {
  shrink_ = shrinkage(task_.penalty, task_.lambda[at_]);
  const double threshold = cutoff();
  for (std::size_t j = 0; j < is_strong_.size(); ++j) {
    if (std::abs(z_(static_cast<Eigen::Index>(j))) > threshold) is_strong_[j] = 1;
  }
  solved_.sweeps.push_back(0);
}

double PathLane::correlation(Eigen::Index j) const {
  double z = problem_->xty(j);
  for (const Eigen::Index k : active_) {
    z -= problem_->gram(k, j) * b_(k);
  }
  return z;
}

/// One pass over the inactive columns in the strong set if `strong`, else over those not in this
/// set. Columns for which the shrinkage gives a nonzero coefficient become active; true if there
/// was such a column.
bool PathLane::admit(bool strong) {
  bool entered = false;
  for (std::size_t i = 0; i < is_active_.size(); ++i) {
    if (is_active_[i] != 0 || (is_strong_[i] != 0) != strong) continue;
    const auto j = static_cast<Eigen::Index>(i);
    z_(j) = correlation(j);
    const double b = shrink_(z_(j));
    if (b == 0.0) continue;
    b_(j) = b;
    is_active_[i] = is_strong_[i] = 1;
    active_.push_back(j);
    entered = true;
  }

  return entered;
}

void PathLane::swept(long count, bool converged) {
  total_ += count;
  solved_.sweeps.back() += count;
  const auto budget_left = [&] { return total_ < task_.max_sweeps; };
  if (!converged && budget_left()) return;
  if (admit(true) && budget_left()) return;
  if (admit(false) && budget_left()) return;
  finish_lambda();
}

void PathLane::finish_lambda() {
  solved_.b.col(static_cast<Eigen::Index>(at_)) = b_;
  ++at_;
  solved_.budget_exhausted = total_ == task_.max_sweeps;
  const Eigen::Index nonzero = (b_.array() != 0.0).count();
  finished_ = at_ == task_.lambda.size() || solved_.budget_exhausted || nonzero > task_.max_nonzero;
  if (!finished_) begin_lambda();
}

SolvedPath PathLane::take() && {
  solved_.b.conservativeResize(Eigen::NoChange, static_cast<Eigen::Index>(at_));
  return std::move(solved_);
}

}  // namespace abbe::calib::sparse
