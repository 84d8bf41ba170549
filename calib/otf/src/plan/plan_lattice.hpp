#pragma once
/// Points at which planned paths may turn, and the path length that a budget permits.

#include <cstddef>
#include <vector>

#include "abbe/calib/otf/plan/plan.hpp"

namespace abbe::calib::otf {

/// Lattice with `per_axis` points for each axis: both ends of the travel and equal steps, rounded
/// to multiples of 0.1 mm; z varies fastest.
[[nodiscard]] std::vector<Vector3> plan_lattice(const MachineNodes&, std::size_t per_axis);

/// Length of the longest path with `legs` legs that the budget permits. For legs shorter than two
/// ramps the duration is overestimated.
[[nodiscard]] double longest_path_m(const PathBudget&, const Drive&, std::size_t legs);
/// Length of the longest path that the budget permits, if its legs have this mean length.
[[nodiscard]] double walk_length_m(const PathBudget&, const Drive&, double mean_leg_m);

}  // namespace abbe::calib::otf
