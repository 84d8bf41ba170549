#pragma once
/// State of one regularisation path between sweeps of coordinate descent. PathLane returns the
/// active columns and the shrinkage for the next sweeps; the caller does the sweeps and reports
/// them by swept(), which adds active columns or goes on to the next lambda.

#include <optional>
#include <span>
#include <vector>

#include "gram.hpp"
#include "shrinkage.hpp"

namespace abbe::calib::sparse {

struct PathTask {
  Penalty penalty;
  std::span<const double> lambda;
  bool first_is_empty = false;  ///< lambda[0] is lambda_max: all coefficients are zero there
  double tolerance = 0.0;       ///< limit for the change of a coefficient, absolute
  long max_sweeps = 0;
  Eigen::Index max_nonzero = 0;
};

/// Coefficients in standardised units, for the columns of the Gram problem.
struct SolvedPath {
  std::vector<long> sweeps;  ///< number of sweeps for each reached lambda
  Eigen::MatrixXd b;         ///< columns x reached
  bool budget_exhausted = false;
};

class PathLane {
 public:
  PathLane(const GramProblem& problem, const PathTask& task);

  [[nodiscard]] bool finished() const { return finished_; }
  [[nodiscard]] long sweeps_left() const { return task_.max_sweeps - total_; }
  [[nodiscard]] double tolerance() const { return task_.tolerance; }
  [[nodiscard]] const Shrinkage& shrinkage_now() const { return shrink_; }
  [[nodiscard]] const std::vector<Eigen::Index>& active() const {
    return active_;
  }  ///< in order of entry
  [[nodiscard]] double& coefficient(Eigen::Index j) { return b_(j); }

  /// To be called after `count` sweeps over active(). `converged`: the largest change in the last
  /// sweep was below the tolerance. If `converged`, or if the budget is used up, the caller must
  /// have updated coefficient() before.
  void swept(long count, bool converged);
  [[nodiscard]] SolvedPath take() &&;

 private:
  [[nodiscard]] bool admit(bool strong);
  void finish_lambda();
  void begin_lambda();
  [[nodiscard]] double cutoff() const;
  [[nodiscard]] double correlation(Eigen::Index j) const;

  const GramProblem* problem_;
  PathTask task_;
  std::size_t at_ = 0;  ///< index of the present lambda
  long total_ = 0;
  bool finished_ = false;
  Shrinkage shrink_;
  Eigen::VectorXd b_;
  Eigen::VectorXd z_;  ///< last computed correlations; current only for inactive columns
  std::vector<char> is_active_, is_strong_;
  std::vector<Eigen::Index> active_;
  SolvedPath solved_;
};

}  // namespace abbe::calib::sparse
