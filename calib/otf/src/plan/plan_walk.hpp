#pragma once
/// The first step of plan(): a walk over a lattice, leg by leg.

#include <cstddef>
#include <span>

#include "abbe/calib/otf/plan/plan.hpp"
#include "plan/plan_problem.hpp"
#include "plan/plan_relaxation.hpp"

namespace abbe::calib::otf {

/// Makes the walk. It begins at the first lattice point, and no leg is driven twice. The remaining
/// length is assumed to be driven as in `rest`; otherwise the first legs would be selected by the
/// prior alone. The walk ends when no leg fits the budget, or with NotConverged if stopped.
[[nodiscard]] Result<Path> greedy_walk(const PlanProblem&, std::span<const Vector3> lattice,
                                       const PathBudget&, const RelaxedDesign& rest,
                                       const Stopped&);

}  // namespace abbe::calib::otf
