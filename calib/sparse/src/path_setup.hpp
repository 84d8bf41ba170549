#pragma once
/// Converts the options of the caller to tasks of the solver, and the solutions to paths in the
/// units of the caller.

#include <vector>

#include "abbe/calib/internal/sparse/path.hpp"
#include "path_lane.hpp"

namespace abbe::calib::sparse {

[[nodiscard]] Result<void> check(const PathOptions&);

struct LambdaList {
  std::vector<double> values;
  bool first_is_empty = false;
};
[[nodiscard]] LambdaList lambda_list(const GramProblem&, const PathOptions&);

/// The returned task refers to `lambda`, which must outlive the task.
[[nodiscard]] PathTask path_task(const GramProblem&, const Penalty&, const LambdaList& lambda,
                                 const PathOptions&);
[[nodiscard]] Path to_path(const GramProblem&, const PathTask&, SolvedPath);

}  // namespace abbe::calib::sparse
