#pragma once
/// The third step of plan(): moves the vertices away from the lattice.

#include <functional>
#include <vector>

#include "abbe/calib/otf/plan/plan.hpp"
#include "plan/plan_problem.hpp"

namespace abbe::calib::otf {

/// Moves the vertices along the projected gradient of trace(G C), inside the travel, with a path no
/// longer than `most_m`. Vertices with `fixed` are not moved. trace(G C) does not increase, unless
/// the path was longer than `most_m` at the beginning. Ends early if PlanOptions::enough returns
/// true. NotConverged if stopped.
[[nodiscard]] Result<Path> descend(const PlanProblem&, Path, const std::vector<bool>& fixed,
                                   double most_m, std::size_t most_steps, const PlanOptions&);

}  // namespace abbe::calib::otf
