#pragma once
/// The first step of plan(): a walk over a lattice, leg by leg.

#include <cstddef>
#include <span>

#include "abbe/calib/otf/plan/plan.hpp"
#include "plan/plan_problem.hpp"
#include "plan/plan_relaxation.hpp"

namespace abbe::calib::otf {

/// Begins at the first lattice point. No leg is driven twice. The length that is left counts as if
/// it were driven as in `rest`: without it the first legs would be chosen against the prior alone.
/// Ends where no leg fits the budget, or with NotConverged if stopped.
[[nodiscard]] Result<Path> greedy_walk(const PlanProblem&, std::span<const Vector3> lattice,
                                       const PathBudget&, const RelaxedDesign& rest,
                                       const Stopped&);

}  // namespace abbe::calib::otf
