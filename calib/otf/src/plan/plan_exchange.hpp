#pragma once
/// The second step of plan(): vertices are inserted, removed or moved to lattice points.

#include <span>
#include <vector>

#include "abbe/calib/otf/plan/plan.hpp"
#include "plan/plan_problem.hpp"

namespace abbe::calib::otf {

/// For each vertex: true for the first vertex, and for the first visit of each corner of the
/// travel. These vertices must not be moved.
[[nodiscard]] std::vector<bool> fixed_vertices(const Path&, const MachineNodes&);

/// Makes exchanges that decrease trace(G C) times length, until no such exchange is known or
/// PlanOptions::exchanges were evaluated. Exchanges are tried in the order of their linear effect
/// and evaluated exactly. An exchange that failed is tried again only after all others have failed.
/// Fixed vertices are not moved. NotConverged if stopped.
[[nodiscard]] Result<Path> exchange_vertices(const PlanProblem&, Path,
                                             std::span<const Vector3> lattice, const PathBudget&,
                                             const PlanOptions&);

/// For each corner of the travel that the path does not reach: moves a vertex to it, if the budget
/// permits the length. The vertex is selected so that trace(G C) times length is smallest.
[[nodiscard]] Path reach_corners(const PlanProblem&, Path, const PathBudget&);

}  // namespace abbe::calib::otf
