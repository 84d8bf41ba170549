#pragma once
/// The second step of plan(): vertices are inserted, removed or moved to lattice points.

#include <span>
#include <vector>

#include "abbe/calib/otf/plan/plan.hpp"
#include "plan/plan_problem.hpp"

namespace abbe::calib::otf {

/// First visits of the corners of the travel, and the first vertex: they stay where they are.
[[nodiscard]] std::vector<bool> fixed_vertices(const Path&, const MachineNodes&);

/// Makes exchanges that decrease trace(G C) times length, until none is known that does, or
/// PlanOptions::exchanges were evaluated. They are tried in the order of their linear effect, and
/// evaluated exactly. One that failed is not tried again before all others have failed. Fixed
/// vertices stay. NotConverged if stopped.
[[nodiscard]] Result<Path> exchange_vertices(const PlanProblem&, Path,
                                             std::span<const Vector3> lattice, const PathBudget&,
                                             const PlanOptions&);

/// Moves a vertex to each corner of the travel that the path does not reach, where its length
/// allows it: the vertex with the least trace(G C) times length afterwards.
[[nodiscard]] Path reach_corners(const PlanProblem&, Path, const PathBudget&);

}  // namespace abbe::calib::otf
