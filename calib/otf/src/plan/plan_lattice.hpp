#pragma once
/// Points at which planned paths may turn, and the length that a budget allows.

#include <cstddef>
#include <vector>

#include "abbe/calib/otf/plan/plan.hpp"

namespace abbe::calib::otf {

/// `per_axis` points for each axis: both ends of the travel and equal steps, as multiples of 0.1
/// mm; z varies fastest.
[[nodiscard]] std::vector<Vector3> plan_lattice(const MachineNodes&, std::size_t per_axis);

/// The longest path of so many legs that a budget allows. For legs shorter than two ramps the
/// duration is overestimated.
[[nodiscard]] double longest_path_m(const PathBudget&, const Drive&, std::size_t legs);
/// The longest path of legs of this mean length.
[[nodiscard]] double walk_length_m(const PathBudget&, const Drive&, double mean_leg_m);

}  // namespace abbe::calib::otf
