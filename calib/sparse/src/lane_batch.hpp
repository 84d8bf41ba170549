#pragma once
/// Solves many paths of one Gram problem, eight at a time: a lane whose path is finished gets the
/// next path.

#include <span>
#include <vector>

#include "path_lane.hpp"

namespace abbe::calib::sparse {

[[nodiscard]] std::vector<SolvedPath> solve_paths(const GramProblem&, std::span<const PathTask>);

}  // namespace abbe::calib::sparse
